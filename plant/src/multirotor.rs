//! Multirotor in six degrees of freedom, for the flights of the paper's section IV-D.
//!
//! A [`Vehicle`] has the constant parts: airframe, rotors, battery, legs, sensors. A [`Flight`] is a vehicle
//! with a state, in a wind, under a held [`Command`]. It is integrated in steps of at most 1 ms and measured by
//! sensors with delay and noise. [`Vehicle::linearised`] is the exact [`Soiptd`](onecycle_onboard::Soiptd) of an
//! axis at hover: the truth for an identification.
//!
//! ```
//! use onecycle_plant::multirotor::{Axis, Command, Flight, Vehicle};
//! use onecycle_plant::Noise;
//!
//! let vehicle = Vehicle::quadrotor();
//! let (mut flight, mut noise) = (Flight::standing(vehicle), Noise::from_seed(1));
//! for _ in 0..500 {
//!     flight.step(Command { thrust: 0.6, ..Command::default() }, 2e-3, &mut noise);
//! }
//! // After a second at more than the thrust of hover it has climbed.
//! assert!(flight.sense(&mut noise).position_m.z > 0.5);
//! // The paper's T_body of altitude, 1.6886 s.
//! let altitude = vehicle.linearised(Axis::Altitude)?;
//! assert!((1.0 / altitude.inv_t_body_per_s() - 1.6886).abs() < 0.005);
//! # Ok::<(), onecycle_plant::multirotor::VehicleError>(())
//! ```

pub mod battery;
pub mod body;
pub mod dynamics;
pub mod error;
pub mod evaluation;
pub mod flight;
pub mod frames;
pub mod ground;
pub mod hover;
pub mod mission;
pub mod mixer;
pub mod pilot;
pub mod rotor;
pub mod sensors;
pub mod vehicle;
pub mod wind;

pub use battery::Battery;
pub use body::{Body, GRAVITY_M_PER_S2};
pub use dynamics::VehicleState;
pub use error::VehicleError;
pub use evaluation::{judged, trace};
pub use flight::Flight;
pub use frames::{Attitude, Vec3};
pub use ground::Legs;
pub use hover::{Axis, Hover};
pub use mission::{Flown, Mission, fly};
pub use mixer::Command;
pub use pilot::{FlightRecord, MissionError, Pilot, Tuned};
pub use rotor::Rotors;
pub use sensors::{Channel, SensorReading, Sensors};
pub use vehicle::{Parts, Vehicle};
pub use wind::{Nudge, Wind};
