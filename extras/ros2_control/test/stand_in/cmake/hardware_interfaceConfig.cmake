# A stand-in: see ../README.md. Of Rolling.
if(NOT TARGET hardware_interface::hardware_interface)
  add_library(hardware_interface::hardware_interface INTERFACE IMPORTED)
  target_include_directories(hardware_interface::hardware_interface INTERFACE ${CMAKE_CURRENT_LIST_DIR}/../rolling)
endif()
