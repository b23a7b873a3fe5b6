# A stand-in: see ../README.md.
if(NOT TARGET pluginlib::pluginlib)
  add_library(pluginlib::pluginlib INTERFACE IMPORTED)
  target_include_directories(pluginlib::pluginlib INTERFACE ${CMAKE_CURRENT_LIST_DIR}/../ros)
endif()

function(pluginlib_export_plugin_description_file category file)
  install(FILES ${file} DESTINATION share/${PROJECT_NAME})
  file(WRITE ${PROJECT_BINARY_DIR}/${category} "share/${PROJECT_NAME}/${file}\n")
  install(FILES ${PROJECT_BINARY_DIR}/${category} DESTINATION share/ament_index/resource_index/${category}__pluginlib__plugin RENAME ${PROJECT_NAME})
endfunction()
