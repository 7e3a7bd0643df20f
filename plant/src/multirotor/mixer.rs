//! Mixer: from a command to four motors, with priorities at saturation.
//!
//! The unit of every command is a motor's full static thrust: `u_i = thrust +- roll +- pitch +- yaw`. Roll and
//! pitch have priority: they are scaled down together only if they alone exceed the range. Then the collective
//! thrust changes by as little as makes room for them. Yaw gets the remaining range.

use super::rotor::ROTOR_POSITIONS;

/// Command of the controllers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Command {
    /// Collective thrust, 0..1 of full static thrust at nominal voltage.
    pub thrust: f64,
    /// Torque that turns the left side up, -1..1: thrust moved from the right motors to the left motors.
    pub roll: f64,
    /// Torque that turns the nose down, -1..1.
    pub pitch: f64,
    /// Torque that turns anticlockwise seen from above, -1..1.
    pub yaw: f64,
}

impl Command {
    /// The command limited to its ranges; infinite components and NaN become zero.
    #[must_use]
    pub fn clamped(&self) -> Self {
        let within = |value: f64, low: f64| {
            if value.is_finite() {
                value.clamp(low, 1.0)
            } else {
                0.0
            }
        };
        Self {
            thrust: within(self.thrust, 0.0),
            roll: within(self.roll, -1.0),
            pitch: within(self.pitch, -1.0),
            yaw: within(self.yaw, -1.0),
        }
    }

    /// Command of each motor, 0..1 of its full static thrust, in the order of [`ROTOR_POSITIONS`].
    #[must_use]
    pub fn motors(&self) -> [f64; 4] {
        let command = self.clamped();
        let tilt =
            ROTOR_POSITIONS.map(|place| place.left * command.roll - place.forward * command.pitch);
        // The pattern is antisymmetric: its extremes are plus and minus `extreme`.
        let extreme = tilt.iter().copied().fold(0.0, f64::max);
        let scale = if extreme > 0.5 { 0.5 / extreme } else { 1.0 };
        let room = extreme * scale;
        let thrust = command.thrust.clamp(room, 1.0 - room);
        let base = tilt.map(|part| thrust + scale * part);
        let mut share: f64 = 1.0;
        for (place, motor) in ROTOR_POSITIONS.iter().zip(base) {
            let part = -place.spin * command.yaw;
            if part > 0.0 {
                share = share.min((1.0 - motor) / part);
            } else if part < 0.0 {
                share = share.min(motor / -part);
            }
        }
        let share = share.max(0.0);
        std::array::from_fn(|i| {
            (base[i] - ROTOR_POSITIONS[i].spin * share * command.yaw).clamp(0.0, 1.0)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The command that four motors correspond to: the inverse of the mixer.
    fn unmixed(motors: [f64; 4]) -> Command {
        let sum = |sign: fn(&super::super::rotor::RotorPosition) -> f64| {
            ROTOR_POSITIONS
                .iter()
                .zip(motors)
                .map(|(p, u)| sign(p) * u)
                .sum::<f64>()
                / 4.0
        };
        Command {
            thrust: sum(|_| 1.0),
            roll: sum(|p| p.left),
            pitch: sum(|p| -p.forward),
            yaw: sum(|p| -p.spin),
        }
    }

    fn assert_close(actual: Command, expected: Command) {
        for (a, e) in [
            (actual.thrust, expected.thrust),
            (actual.roll, expected.roll),
            (actual.pitch, expected.pitch),
            (actual.yaw, expected.yaw),
        ] {
            assert!((a - e).abs() < 1e-15, "{actual:?} {expected:?}");
        }
    }

    fn command(thrust: f64, roll: f64, pitch: f64, yaw: f64) -> Command {
        Command {
            thrust,
            roll,
            pitch,
            yaw,
        }
    }

    // The four patterns are orthogonal: within the range the motors give the command back.
    #[test]
    fn the_mixer_has_an_inverse() {
        let asked = command(0.5, 0.1, -0.2, 0.15);
        assert_close(unmixed(asked.motors()), asked);
    }

    // By hand. Thrust 0.9 with roll 0.3: the left motors would need 1.2, so the thrust falls to 0.7. No thrust
    // with roll 0.2: the thrust rises to 0.2. Roll 0.8 and pitch 0.4 need 1.2: scaled to 1/3 and 1/6 about half
    // thrust. Yaw 0.5 at thrust 0.8 has a range of 0.2; with roll 0.3 at thrust 0.7 it has none.
    #[test]
    fn roll_and_pitch_before_thrust_before_yaw() {
        for (asked, given) in [
            (command(0.9, 0.3, 0.0, 0.0), command(0.7, 0.3, 0.0, 0.0)),
            (command(0.0, 0.2, 0.0, 0.0), command(0.2, 0.2, 0.0, 0.0)),
            (
                command(0.1, 0.8, 0.4, 0.0),
                command(0.5, 1.0 / 3.0, 1.0 / 6.0, 0.0),
            ),
            (command(0.8, 0.0, 0.0, 0.5), command(0.8, 0.0, 0.0, 0.2)),
            (command(0.7, 0.3, 0.0, -0.4), command(0.7, 0.3, 0.0, 0.0)),
            (command(0.0, 0.0, 0.0, 1.0), command(0.0, 0.0, 0.0, 0.0)),
        ] {
            assert_close(unmixed(asked.motors()), given);
        }
    }

    // Values out of range are limited; NaN becomes zero.
    #[test]
    fn wild_commands_are_tamed() {
        let wild = command(f64::NAN, 7.0, f64::NEG_INFINITY, -3.0);
        assert_close(wild.clamped(), command(0.0, 1.0, 0.0, -1.0));
        assert!(wild.motors().iter().all(|u| (0.0..=1.0).contains(u)));
    }
}
