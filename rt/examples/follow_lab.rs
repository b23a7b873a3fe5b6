//! Temporary.
use takt_rt::plan::State;
use takt_rt::*;
const H: f64 = 1e-3;
fn main() {
    let limits = AxisLimits { position_min: -3.0, position_max: 3.0, velocity: 2.4, acceleration: 8.0, deceleration: 8.0, jerk: 100.0, torque: 40.0 };
    let sine = |t: f64| { let w = std::f64::consts::PI; State { position: 0.2 * (w * t).sin(), velocity: 0.2 * w * (w * t).cos(), acceleration: -0.2 * w * w * (w * t).sin() } };
    let reach = |t: f64| { let u = ((t-2.0) / 1.0).clamp(0.0, 1.0); let d=0.5; State { position: d * u * u * u * (10.0 - 15.0 * u + 6.0 * u * u), velocity: d*30.0*u*u*(1.0-u)*(1.0-u), acceleration: d*60.0*u*(1.0-3.0*u+2.0*u*u) } };
    let step = |t: f64| State::rest(if t > 2.0 { 0.019 } else { 0.0 });
    let sources: [(&str, &dyn Fn(f64) -> State); 3] = [("sine", &sine), ("reach", &reach), ("step", &step)];
    for (name, f) in sources {
        for with_v in [false, true] {
            for rate in [5.0, 10.0, 30.0, 50.0, 100.0, 250.0, 500.0, 1000.0] {
                for kind in ["clean", "jitter", "loss", "unstamped"] {
                    run(name, f, with_v, rate, kind, &limits);
                }
            }
        }
    }
}
fn run(name: &str, f: &dyn Fn(f64) -> State, with_v: bool, rate: f64, kind: &str, limits: &AxisLimits) {
    let mut seed = 12345u64;
    let mut random = move || { seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407); ((seed >> 33) as f64) / (1u64 << 31) as f64 };
    let base = 1_000_000_000u64;
    let mut arrivals: Vec<(u64, StreamPoint<1>)> = vec![];
    for k in 0..(10.0 * rate) as u64 {
        let at = (k as f64 / rate * 1e9) as u64;
        let s = f(at as f64 * 1e-9);
        if kind == "loss" && random() < 0.05 { continue; }
        let late = if kind == "jitter" || kind == "unstamped" { (random() - 0.5) / rate * 1e9 } else { 0.0 };
        let arrive = base + (at as i64 + late as i64).max(0) as u64;
        let stamp = if kind == "unstamped" { arrive } else { base + at };
        arrivals.push((arrive, StreamPoint { at_ns: stamp, role: PointRole::Single, axes: [if with_v { AxisPoint::moving(s.position, s.velocity) } else { AxisPoint::position(s.position) }] }));
    }
    arrivals.sort_by_key(|a| a.0);
    let mut ahead = LookAhead::<1, _>::new(vec![StreamPoint::default(); 256], LookAheadParameters { limits: [*limits].into_iter().collect(), period_ns: 1_000_000, delay: StreamDelay::Automatic });
    let mut state = State::rest(0.0);
    let mut next = 0;
    let (mut error, mut peak, mut over, mut viol, mut dry) = (0.0f64, 0.0f64, 0.0f64, 0, 0);
    let mut hist = vec![0.0; 4];
    let mut lag = 0; let mut lagmax = 0;
    for slot in 0..9_500u64 {
        let now = base + slot * 1_000_000;
        while next < arrivals.len() && arrivals[next].0 <= now { let _ = ahead.insert(&arrivals[next].1, now); next += 1; }
        let sample = ahead.sample(now);
        lag = sample.counts.lag_ns; lagmax = lagmax.max(lag);
        match sample.wish {
            StreamWish::Targets([AxisTarget::Position(target)]) => { state = follow(&state, &target, limits, H).unwrap(); }
            StreamWish::Dry([AxisTarget::Position(target)]) => { dry += 1; state = follow(&state, &target, limits, H).unwrap(); }
            _ => {}
        }
        let t = (now - base - lag.min(now-base)) as f64 * 1e-9;
        if slot > 1500 { error = error.max((state.position - f(t).position).abs()); over = over.max(state.position - 0.019);}
        hist.remove(0); hist.push(state.position);
        if slot > 4 {
        let j = (hist[3] - 3.0 * hist[2] + 3.0 * hist[1] - hist[0]) / H.powi(3);
        let a = (hist[3] - 2.0 * hist[2] + hist[1]) / H / H; let v = (hist[3] - hist[2]) / H;
        if slot > 1500 { peak = peak.max(j.abs()); }
        if j.abs() > limits.jerk * (1.0 + 1e-5)+1e-4 || a.abs() > limits.acceleration * (1.0 + 1e-6) + 1e-6 || v.abs() > limits.velocity * (1.0 + 1e-6) { viol += 1; }
        }
    }
    println!("{name:6} v={with_v:5} {rate:5} {kind:9} err {:8.4} mrad  lag {:6.1} max {:6.1} ms  jerk {:7.2} over {:9.2e} viol {viol} dry {dry} late {} lost {}", error * 1e3, lag as f64 * 1e-6, lagmax as f64*1e-6, peak, over, ahead.counts().late_points, ahead.counts().lost_points);
}
