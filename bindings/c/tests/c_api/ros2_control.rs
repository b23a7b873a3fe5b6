//! The plugin of ros2_control: compiled against stand-ins for the packages of ROS, installed, and led through its life.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::library::{Installed, Library, MEMORY, crate_folder, is_here, repository, succeeds};
use crate::programs::blocks_of;

#[test]
#[ignore = "the part ros2_control runs it"]
fn a_controller_manager_of_humble_or_of_rolling_leads_the_system_of_ros2_control_through_its_life() {
    let takt = Installed::new();
    for of in ["humble", "rolling"] {
        led_through_its_life(&takt, of);
    }
}

fn led_through_its_life(takt: &Installed, of: &str) {
    let package = crate_folder().join("../../extras/ros2_control");
    let include = |folder: &str| format!("-I{}", package.join(folder).display());
    let stand_ins = [include("test/stand_in/ros"), include(&format!("test/stand_in/{of}"))];
    let more = [MEMORY[0], MEMORY[1], &include("include"), &stand_ins[0], &stand_ins[1]];
    let sources = [package.join("test/drive_system.cpp"), package.join("src/takt_system.cpp")];
    let compiled = takt.compile_all(&[&sources[0], &sources[1]], &more, Library::Shared);
    let urdf = package.join("urdf/arm.ros2_control.urdf");
    let configuration = repository().join("configs/arm6-erob-cst.toml");
    let said =
        succeeds(Command::new(compiled).arg(configuration).arg(urdf).current_dir(takt.programs.path()));
    assert!(said.contains("the system has lived its life"), "{said}");
}

/// `CMakeLists.txt`, against stand-ins for the packages that it needs of ROS; a program of another package finds what it installs.
#[test]
#[ignore = "the part ros2_control runs it"]
fn the_ament_package_of_ros2_control_is_built_and_installed_by_cmake_and_found_by_others() {
    let takt = Installed::new();
    let package = crate_folder().join("../../extras/ros2_control").canonicalize().unwrap();
    let folder = takt.programs.path();
    let prefix = folder.join("install");
    let stand_ins = package.join("test/stand_in/cmake");
    let places = format!("{};{};{}", takt.prefix.display(), stand_ins.display(), prefix.display());
    let build = |source: &Path, name: &str| {
        let mut configure = Command::new("cmake");
        configure.args(["-DCMAKE_CXX_FLAGS=-Werror", "-S"]).arg(source).arg("-B").arg(folder.join(name));
        configure.arg(format!("-DCMAKE_PREFIX_PATH={places}"));
        succeeds(configure.arg(format!("-DCMAKE_INSTALL_PREFIX={}", prefix.display())));
        succeeds(Command::new("cmake").arg("--build").arg(folder.join(name)));
    };
    build(&package, "package");
    succeeds(Command::new("cmake").arg("--install").arg(folder.join("package")));
    let share = prefix.join("share/takt_ros2_control");
    for file in [
        "package.xml",
        "takt_system.xml",
        "urdf/arm.ros2_control.urdf",
        "config/arm.yaml",
        "launch/arm.launch.xml",
    ] {
        assert!(share.join(file).is_file(), "{file} is not installed");
    }
    build(&package.join("test/uses"), "uses");
    let mut command = Command::new(folder.join("uses/drive_system"));
    command
        .arg(repository().join("configs/arm6-erob-cst.toml"))
        .arg(share.join("urdf/arm.ros2_control.urdf"));
    let said = succeeds(command.current_dir(folder));
    assert!(said.contains("the system has lived its life"), "{said}");
}

#[test]
fn what_is_launched_in_ros2_control_has_its_controllers_and_these_their_joints_and_interfaces() {
    let read =
        |file: &str| fs::read_to_string(crate_folder().join("../../extras/ros2_control").join(file)).unwrap();
    let (launch, urdf) = (read("bringup/launch/arm.launch.xml"), read("urdf/arm.ros2_control.urdf"));
    let controllers = read("bringup/config/arm.yaml");
    let tag = urdf.split("<ros2_control").nth(1).unwrap();
    let spawned =
        launch.split("exec=\"spawner\" args=\"").skip(1).map(|rest| rest.split(' ').next().unwrap());
    let spawned: Vec<&str> = spawned.collect();
    assert_eq!(spawned.len(), 3, "{launch}");
    for name in &spawned {
        let own = controllers.split(&format!("\n{name}:\n  ros__parameters:\n")).nth(1).unwrap();
        let own = own.split("\n\n").next().unwrap();
        let list = |key: &str| {
            let found = own.lines().find_map(|line| line.trim().strip_prefix(key)?.strip_prefix(": "));
            found.unwrap_or_default().trim_matches(['[', ']']).split(", ").filter(|item| !item.is_empty())
        };
        let kind = list("type").next().unwrap();
        assert!(controllers.contains(&format!("    {name}: {{type: {kind}}}\n")), "{name}");
        for joint in list("joints") {
            let joint = tag.split(&format!("<joint name=\"{joint}\">")).nth(1).unwrap();
            let joint = joint.split("</joint>").next().unwrap();
            for command in list("command_interfaces").chain(list("interface_name")) {
                assert!(
                    joint.contains(&format!("<command_interface name=\"{command}\"/>")),
                    "{name}: {command}"
                );
            }
            for shown in list("state_interfaces") {
                assert!(joint.contains(&format!("<state_interface name=\"{shown}\"/>")), "{name}: {shown}");
            }
        }
    }
    let needed = read("package.xml");
    let packages = launch.split("pkg=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
    let kinds = controllers.split("{type: ").skip(1).map(|rest| rest.split('/').next().unwrap());
    for package in packages.chain(kinds) {
        assert!(needed.contains(&format!("<exec_depend>{package}</exec_depend>")), "{package}");
    }
}

/// What its page has for those who try it without ROS.
#[test]
#[ignore = "the part ros2_control runs it"]
fn the_commands_of_the_page_of_ros2_control_lead_the_system_through_its_life() {
    if !is_here("pkg-config") {
        eprintln!("pkg-config is not here; tests/run installs it");
        return;
    }
    let takt = Installed::new();
    let folder = takt.programs.path();
    for name in ["configs", "extras"] {
        std::os::unix::fs::symlink(repository().join(name), folder.join(name)).unwrap();
    }
    // The first of them needs ROS.
    let commands = blocks_of("extras/ros2_control/README.md", "sh");
    assert_eq!(commands.len(), 2, "{commands:?}");
    let said = succeeds(&mut takt.shell(&commands[1]));
    assert!(said.contains("the system has lived its life"), "{said}");
}
