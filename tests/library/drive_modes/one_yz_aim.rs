//! A machine of one axis.

/// One YZ-AIM on a ball screw in this mode, on a bus at half the rate of the controller, and one step of its program.
pub fn one_yz_aim(mode: &str, step: &str) -> String {
    format!(
        r#"
name = "one"
[[bus]]
name = "can"
period = "2 ms"
[[axis]]
name = "x"
bus = "can"
node = 1
drive = "yz-aim"
mode = "{mode}"
travel = "linear"
lead = "10 mm"
[axis.limits]
position = ["0 mm", "800 mm"]
velocity = "0.15 m/s"
acceleration = "1 m/s^2"
torque = "300 N"
[axis.joint]
inertia = "4 kg"
viscous_friction = "20 N s/m"
coulomb_friction = "5 N"
[[program.move]]
{step}
"#
    )
}
