//! How each firmware is taken over for the test and handed back.

use std::time::Duration;

use mavlink::dialects::common::{
    AttitudeTargetTypemask, MavCmd, MavFrame, MavMessage, PositionTargetTypemask,
    SET_ATTITUDE_TARGET_DATA, SET_POSITION_TARGET_LOCAL_NED_DATA,
};
use onecycle_link::FirmwareKind;

use super::AltitudeRefusal;
use crate::mode::{self, COPTER_GUIDED, PX4_HOLD, PX4_OFFBOARD, Px4Mode};
use crate::vehicle::Vehicle;
use crate::write::{Assignment, Outcome, Plan};

/// `GUID_OPTIONS`: SET_ATTITUDE_TARGET has a thrust, not a climb rate.
const THRUST_AS_THRUST: u32 = 1 << 3;
/// Time to restore a parameter over a link that is away.
const PATIENCE: Duration = Duration::from_secs(20);

/// Attitude and place of the hover.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hover {
    pub(super) thrust: f64,
    /// Roll, pitch and yaw (rad).
    pub(super) angles_rad: [f64; 3],
    /// North, east, down (m).
    pub(super) place_m: [f32; 3],
    /// Standard deviation of the height (m).
    pub(super) wander_m: f64,
}

/// A firmware whose altitude can be tested.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Pilot {
    Px4,
    Copter,
}

impl Pilot {
    /// # Errors
    /// Another firmware, or another mode than the one that the test returns to.
    pub(super) fn of(vehicle: &Vehicle) -> Result<Self, AltitudeRefusal> {
        let heartbeat = vehicle.seen.heartbeat.as_ref();
        let heartbeat = heartbeat.ok_or(AltitudeRefusal::Firmware)?;
        let pilot = match vehicle.firmware() {
            Some(FirmwareKind::Px4) => Self::Px4,
            Some(FirmwareKind::ArduPilot) if mode::is_copter(heartbeat.mavtype) => Self::Copter,
            _ => return Err(AltitudeRefusal::Firmware),
        };
        match heartbeat.custom_mode == pilot.holding() {
            true => Ok(pilot),
            false => Err(AltitudeRefusal::Mode {
                wanted: pilot.holding_name(),
                found: mode::name(heartbeat),
            }),
        }
    }

    pub(super) fn firmware(self) -> FirmwareKind {
        match self {
            Self::Px4 => FirmwareKind::Px4,
            Self::Copter => FirmwareKind::ArduPilot,
        }
    }

    /// Number of the mode before and after the test.
    fn holding(self) -> u32 {
        match self {
            Self::Px4 => PX4_HOLD.number(),
            Self::Copter => COPTER_GUIDED,
        }
    }

    fn holding_name(self) -> &'static str {
        match self {
            Self::Px4 => "Hold",
            Self::Copter => "Guided",
        }
    }

    /// Number of the mode during the test.
    fn testing(self) -> u32 {
        match self {
            Self::Px4 => PX4_OFFBOARD.number(),
            Self::Copter => COPTER_GUIDED,
        }
    }

    pub(super) fn testing_name(self) -> &'static str {
        match self {
            Self::Px4 => "Offboard",
            Self::Copter => "Guided",
        }
    }

    pub(super) fn is_testing(self, vehicle: &Vehicle) -> bool {
        mode_number(vehicle) == Some(self.testing())
    }

    /// Whether the mode is the one after the test, so that the vehicle holds its place.
    pub(super) fn is_holding(self, vehicle: &Vehicle) -> bool {
        mode_number(vehicle) == Some(self.holding())
    }

    /// Whether the mode is neither that of the test nor that before it: the pilot has the vehicle.
    pub(super) fn is_taken(self, vehicle: &Vehicle) -> bool {
        !self.is_testing(vehicle) && !self.is_holding(vehicle)
    }

    /// Lets ArduCopter take the thrust as a thrust. The plan that restores what was changed; `None`: nothing was.
    pub(super) fn prepare(self, vehicle: &mut Vehicle) -> Result<Option<Plan>, AltitudeRefusal> {
        if self == Self::Px4 {
            return Ok(None);
        }
        const NAME: &str = "GUID_OPTIONS";
        let old = vehicle.parameter(NAME)?.value;
        let new = f64::from(old as u32 | THRUST_AS_THRUST);
        if new == old {
            return Ok(None);
        }
        let one = |value| {
            let name = NAME.to_owned();
            [Assignment { name, value }]
        };
        let plan = Plan::new(vehicle, &one(new), true)?;
        match plan.run(vehicle, PATIENCE, |_| {}) {
            Outcome::Written => Ok(Some(plan.reversed())),
            Outcome::RolledBack(cause) | Outcome::Uncertain(cause, _) => Err(cause.into()),
        }
    }

    /// Restores what [`Self::prepare`] has changed; whether that could be read back.
    pub(super) fn restore(vehicle: &mut Vehicle, plan: &Plan) -> bool {
        matches!(plan.run(vehicle, PATIENCE, |_| {}), Outcome::Written)
    }

    /// Asks for the mode of the test.
    pub(super) fn take(self, vehicle: &mut Vehicle) {
        if self == Self::Px4 {
            set_px4_mode(vehicle, PX4_OFFBOARD);
        }
    }

    /// Asks the vehicle to hold its place.
    pub(super) fn hand_back(self, vehicle: &mut Vehicle, hover: &Hover) {
        match self {
            Self::Px4 => set_px4_mode(vehicle, PX4_HOLD),
            Self::Copter => hold_place(vehicle, hover),
        }
    }
}

fn mode_number(vehicle: &Vehicle) -> Option<u32> {
    let number = vehicle.seen.heartbeat.as_ref()?.custom_mode;
    Some(match vehicle.firmware() {
        Some(FirmwareKind::Px4) => Px4Mode::of(number).number(),
        _ => number,
    })
}

fn set_px4_mode(vehicle: &mut Vehicle, mode: Px4Mode) {
    // 1: the numbers are those of the firmware (`MAV_MODE_FLAG_CUSTOM_MODE_ENABLED`).
    let parameters = [1.0, f32::from(mode.main), f32::from(mode.sub)];
    vehicle.send_command(MavCmd::MAV_CMD_DO_SET_MODE, parameters);
}

/// A set-point of the attitude of the hover and a thrust.
pub(super) fn set_thrust(vehicle: &mut Vehicle, hover: &Hover, thrust: f64) {
    let (target_system, target_component) = vehicle.target();
    let type_mask = AttitudeTargetTypemask::ATTITUDE_TARGET_TYPEMASK_BODY_ROLL_RATE_IGNORE
        | AttitudeTargetTypemask::ATTITUDE_TARGET_TYPEMASK_BODY_PITCH_RATE_IGNORE
        | AttitudeTargetTypemask::ATTITUDE_TARGET_TYPEMASK_BODY_YAW_RATE_IGNORE;
    vehicle.send(&MavMessage::SET_ATTITUDE_TARGET(SET_ATTITUDE_TARGET_DATA {
        time_boot_ms: 0,
        q: quaternion(hover.angles_rad),
        body_roll_rate: 0.0,
        body_pitch_rate: 0.0,
        body_yaw_rate: 0.0,
        thrust: thrust as f32,
        target_system,
        target_component,
        type_mask,
    }));
}

/// The quaternion of roll, pitch and yaw (rad).
fn quaternion(angles_rad: [f64; 3]) -> [f32; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] = angles_rad.map(|angle| (0.5 * angle).sin_cos());
    [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
    .map(|part| part as f32)
}

/// A set-point of the position and heading of the hover.
fn hold_place(vehicle: &mut Vehicle, hover: &Hover) {
    let (target_system, target_component) = vehicle.target();
    let [x, y, z] = hover.place_m;
    use PositionTargetTypemask as Mask;
    let type_mask = Mask::POSITION_TARGET_TYPEMASK_VX_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_VY_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_VZ_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_AX_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_AY_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_AZ_IGNORE
        | Mask::POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE;
    vehicle.send(&MavMessage::SET_POSITION_TARGET_LOCAL_NED(
        SET_POSITION_TARGET_LOCAL_NED_DATA {
            time_boot_ms: 0,
            x,
            y,
            z,
            vx: 0.0,
            vy: 0.0,
            vz: 0.0,
            afx: 0.0,
            afy: 0.0,
            afz: 0.0,
            yaw: hover.angles_rad[2] as f32,
            yaw_rate: 0.0,
            type_mask,
            target_system,
            target_component,
            coordinate_frame: MavFrame::MAV_FRAME_LOCAL_NED,
        },
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    // By hand: a yaw of 90 degrees is (cos 45, 0, 0, sin 45); a roll of 60 degrees is (cos 30, sin 30, 0, 0).
    #[test]
    fn quaternions_by_hand() {
        let half = std::f32::consts::FRAC_1_SQRT_2;
        let close = |a: [f32; 4], b: [f32; 4]| {
            assert!(
                a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6),
                "{a:?} {b:?}"
            );
        };
        let right = std::f64::consts::FRAC_PI_2;
        close(quaternion([0.0, 0.0, right]), [half, 0.0, 0.0, half]);
        close(
            quaternion([right / 1.5, 0.0, 0.0]),
            [0.75_f32.sqrt(), 0.5, 0.0, 0.0],
        );
    }
}
