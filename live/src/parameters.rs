//! Parameters of the vehicle: read by name, set, in the encoding of the firmware.

use std::collections::BTreeMap;
use std::time::Duration;

use mavlink::dialects::common::{
    MavMessage, MavParamError, MavParamType, PARAM_REQUEST_READ_DATA, PARAM_SET_DATA,
    PARAM_VALUE_DATA,
};

use crate::error::LiveError;
use crate::vehicle::{ANSWER, Encoding, TRIES, Vehicle};

/// Number of questions that are sent before the answers are awaited: what a slow radio carries in [`ANSWER`].
const AT_ONCE: usize = 16;

/// A parameter that is asked for so often, while others are answered, is not there: with a quarter of the messages lost each
/// way, one in a thousand fails so often.
const MISSING: usize = 9;

/// Time to the next answer, once one has come.
const NEXT: Duration = Duration::from_millis(300);

/// How often a parameter is set whose setting is not answered.
const SETTINGS: usize = 3 * TRIES;

/// A parameter as the vehicle has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameter {
    /// Value. Exact: of single precision, or an integer of 32 bits.
    pub value: f64,
    kind: MavParamType,
}

impl Parameter {
    /// Whether the vehicle stores it as an integer.
    pub fn is_integer(&self) -> bool {
        !matches!(
            self.kind,
            MavParamType::MAV_PARAM_TYPE_REAL32 | MavParamType::MAV_PARAM_TYPE_REAL64
        )
    }

    /// The parameter with another value.
    pub(crate) fn with(self, value: f64) -> Self {
        Self { value, ..self }
    }

    /// The value as the vehicle can store it: in single precision. `None` if the vehicle stores an integer and the value is a fraction.
    pub(crate) fn stored(&self, value: f64) -> Option<f64> {
        match self.is_integer() {
            true => (value.fract() == 0.0 && value.abs() <= f64::from(u32::MAX)).then_some(value),
            false => Some(f64::from(value as f32)),
        }
    }

    fn of_message(message: &PARAM_VALUE_DATA, encoding: Encoding) -> Self {
        let bits = message.param_value.to_bits();
        let value = match (encoding, message.param_type) {
            (Encoding::Bytewise, MavParamType::MAV_PARAM_TYPE_INT32) => f64::from(bits as i32),
            (Encoding::Bytewise, MavParamType::MAV_PARAM_TYPE_UINT32) => f64::from(bits),
            (Encoding::Bytewise, MavParamType::MAV_PARAM_TYPE_INT16) => f64::from(bits as i16),
            (Encoding::Bytewise, MavParamType::MAV_PARAM_TYPE_UINT16) => f64::from(bits as u16),
            (Encoding::Bytewise, MavParamType::MAV_PARAM_TYPE_INT8) => f64::from(bits as i8),
            (Encoding::Bytewise, MavParamType::MAV_PARAM_TYPE_UINT8) => f64::from(bits as u8),
            _ => f64::from(message.param_value),
        };
        Self {
            value,
            kind: message.param_type,
        }
    }

    fn encoded(&self, encoding: Encoding) -> f32 {
        match encoding {
            // The bits below the size of the type are those of the two's complement.
            Encoding::Bytewise if self.is_integer() => f32::from_bits(self.value as i64 as u32),
            _ => self.value as f32,
        }
    }
}

/// What is known of a parameter after it was asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Found {
    /// Its value.
    Here(Parameter),
    /// The firmware does not have it.
    Missing,
}

impl Vehicle {
    /// Reads parameters by name. `None`: the firmware does not have it.
    ///
    /// # Errors
    /// The link is lost.
    pub fn parameters(
        &mut self,
        names: &[String],
    ) -> Result<BTreeMap<String, Option<Parameter>>, LiveError> {
        let mut found = BTreeMap::new();
        for some in names.chunks(AT_ONCE) {
            self.read_some(some, &mut found)?;
        }
        let value = |found| match found {
            Found::Here(parameter) => Some(parameter),
            Found::Missing => None,
        };
        Ok(found
            .into_iter()
            .map(|(name, found)| (name, value(found)))
            .collect())
    }

    /// Reads one parameter.
    ///
    /// # Errors
    /// The firmware does not have it, or the link is lost.
    pub fn parameter(&mut self, name: &str) -> Result<Parameter, LiveError> {
        let found = self.parameters(&[name.to_owned()])?.remove(name).flatten();
        found.ok_or_else(|| LiveError::NoParameter(name.to_owned()))
    }

    fn read_some(
        &mut self,
        names: &[String],
        found: &mut BTreeMap<String, Found>,
    ) -> Result<(), LiveError> {
        let (mut answered, mut silent) = (0, 0);
        while answered < MISSING && silent < TRIES {
            let is_left = |name: &&String| !found.contains_key(*name);
            let left: Vec<&String> = names.iter().filter(is_left).collect();
            if left.is_empty() {
                return Ok(());
            }
            for name in &left {
                self.ask(name, -1);
            }
            // Much firmware says nothing about a name that it does not have, but it does answer about the first parameter.
            if answered + silent > 0 {
                self.ask("", 0);
            }
            match self.take_answers(names, found) {
                true => (answered, silent) = (answered + 1, 0),
                false => silent += 1,
            }
        }
        if silent == TRIES {
            return Err(LiveError::Lost);
        }
        for name in names {
            found.entry(name.clone()).or_insert(Found::Missing);
        }
        Ok(())
    }

    /// Takes values in until all names are known, or no more come. Whether any came.
    fn take_answers(&mut self, names: &[String], found: &mut BTreeMap<String, Found>) -> bool {
        let mut until = self.now() + ANSWER;
        let mut is_answering = false;
        while let Some(message) = self.receive(until) {
            let (name, answer) = match &message {
                MavMessage::PARAM_VALUE(of) => {
                    let parameter = Parameter::of_message(of, self.encoding());
                    (of.param_id, Found::Here(parameter))
                }
                MavMessage::PARAM_ERROR(of)
                    if of.error == MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST =>
                {
                    (of.param_id, Found::Missing)
                }
                _ => continue,
            };
            is_answering = true;
            until = self.now() + NEXT;
            let name = name.to_str().unwrap_or_default();
            if names.iter().any(|own| own == name) {
                found.insert(name.to_owned(), answer);
            }
            if names.iter().all(|name| found.contains_key(name)) {
                break;
            }
        }
        is_answering
    }

    fn ask(&mut self, name: &str, param_index: i16) {
        let (target_system, target_component) = self.target();
        self.send(&MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
            param_index,
            target_system,
            target_component,
            param_id: name.into(),
        }));
    }

    /// Sets a parameter and reads it back, a few times if need be. Returns the value that the vehicle has then, which is
    /// another one if it refuses this one.
    pub(crate) fn set(&mut self, name: &str, wanted: Parameter) -> Result<f64, LiveError> {
        let (mut now, mut refusals) = (None, 0);
        for _ in 0..SETTINGS {
            let (target_system, target_component) = self.target();
            self.send(&MavMessage::PARAM_SET(PARAM_SET_DATA {
                param_value: wanted.encoded(self.encoding()),
                target_system,
                target_component,
                param_id: name.into(),
                param_type: wanted.kind,
            }));
            // The answer to the setting may be an older one on its way; a reading of its own decides.
            let until = self.now() + ANSWER;
            let mut is_answered = false;
            while let Some(message) = self.receive(until) {
                let about = match message {
                    MavMessage::PARAM_VALUE(of) => of.param_id,
                    MavMessage::PARAM_ERROR(of) => of.param_id,
                    _ => continue,
                };
                if about.to_str() == Ok(name) {
                    is_answered = true;
                    break;
                }
            }
            let read = self.parameter(name)?;
            now = Some(read.value);
            refusals += usize::from(is_answered);
            if read.value == wanted.value || refusals == TRIES {
                break;
            }
        }
        now.ok_or(LiveError::Lost)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(value: f32, kind: MavParamType) -> PARAM_VALUE_DATA {
        PARAM_VALUE_DATA {
            param_value: value,
            param_count: 1,
            param_index: 0,
            param_id: "A".into(),
            param_type: kind,
        }
    }

    // PX4: the integer 5 has the bits of 7e-45; -1 those of a NaN. ArduPilot sends 5.0 and -1.0.
    #[test]
    fn both_encodings() {
        let kinds = [
            (
                MavParamType::MAV_PARAM_TYPE_INT32,
                vec![5.0, -1.0, 2_147_483_647.0, -2_147_483_648.0],
            ),
            (
                MavParamType::MAV_PARAM_TYPE_UINT32,
                vec![0.0, 4_294_967_295.0],
            ),
            (MavParamType::MAV_PARAM_TYPE_INT16, vec![-32768.0, 32767.0]),
            (MavParamType::MAV_PARAM_TYPE_INT8, vec![-128.0, 127.0]),
            (MavParamType::MAV_PARAM_TYPE_UINT8, vec![255.0]),
            (
                MavParamType::MAV_PARAM_TYPE_REAL32,
                vec![0.15_f32.into(), -3.0],
            ),
        ];
        for (kind, values) in kinds {
            for value in values {
                let own = Parameter { value, kind };
                let sent = own.encoded(Encoding::Bytewise);
                assert_eq!(
                    Parameter::of_message(&message(sent, kind), Encoding::Bytewise),
                    own
                );
                if value.abs() < 16_777_216.0 {
                    let sent = own.encoded(Encoding::CCast);
                    assert_eq!(f64::from(sent), value);
                    assert_eq!(
                        Parameter::of_message(&message(sent, kind), Encoding::CCast),
                        own
                    );
                }
            }
        }
        let five = Parameter {
            value: 5.0,
            kind: MavParamType::MAV_PARAM_TYPE_INT32,
        };
        assert_eq!(five.encoded(Encoding::Bytewise).to_bits(), 5);
    }

    #[test]
    fn what_a_vehicle_can_store() {
        let of = |kind| Parameter { value: 0.0, kind };
        let integer = of(MavParamType::MAV_PARAM_TYPE_INT32);
        assert_eq!(integer.stored(1.5), None);
        assert_eq!(integer.stored(16_777_217.0), Some(16_777_217.0));
        let real = of(MavParamType::MAV_PARAM_TYPE_REAL32);
        assert_eq!(real.stored(0.1), Some(f64::from(0.1_f32)));
    }
}
