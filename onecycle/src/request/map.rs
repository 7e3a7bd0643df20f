//! Requests from a map of settings, each a number, a text, or a list of numbers. A setting that is null is left out, and so is a
//! false one other than `design`.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};

use super::{DesignRequest, Request, SCHEMA};
use crate::error::Error;

/// What is set by names.
trait Settings: Default {
    fn put(&mut self, name: &str, value: &str) -> Result<(), Error>;
}

impl Settings for Request {
    fn put(&mut self, name: &str, value: &str) -> Result<(), Error> {
        self.set(name, value)
    }
}

impl Settings for DesignRequest {
    fn put(&mut self, name: &str, value: &str) -> Result<(), Error> {
        self.set(name, value)
    }
}

impl<'de> Deserialize<'de> for Request {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Map(PhantomData))
    }
}

impl<'de> Deserialize<'de> for DesignRequest {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(Map(PhantomData))
    }
}

struct Map<T>(PhantomData<T>);

impl<'de, T: Settings> Visitor<'de> for Map<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a map of settings")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<T, A::Error> {
        let mut request = T::default();
        while let Some((name, Text(value))) = map.next_entry::<String, Text>()? {
            match (name.as_str(), value) {
                (_, None) => {}
                // What a request does without being asked is the only thing that false takes out.
                (name, Some(value)) if value == "false" && name != "design" => {}
                ("schema", Some(value)) if value == SCHEMA => {}
                ("schema", Some(_)) => {
                    return Err(A::Error::custom(format!("the schema must be {SCHEMA}")));
                }
                (name, Some(value)) => request.put(name, &value).map_err(A::Error::custom)?,
            }
        }
        Ok(request)
    }
}

/// A value as text.
struct Text(Option<String>);

impl<'de> Deserialize<'de> for Text {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(TextVisitor).map(Self)
    }
}

struct TextVisitor;

impl<'de> Visitor<'de> for TextVisitor {
    type Value = Option<String>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a number, a text, or a list of numbers")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Self::Value, E> {
        Ok(Some(value.to_string()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Self::Value, E> {
        Ok(Some(value.to_string()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Self::Value, E> {
        Ok(Some(value.to_string()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Self::Value, E> {
        Ok(Some(value.to_string()))
    }

    fn visit_str<E>(self, value: &str) -> Result<Self::Value, E> {
        Ok(Some(value.to_owned()))
    }

    fn visit_unit<E>(self) -> Result<Self::Value, E> {
        Ok(None)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element::<f64>()? {
            values.push(value.to_string());
        }
        Ok(Some(values.join(",")))
    }
}

#[cfg(test)]
mod tests {
    use onecycle_design::{Pid, Style};
    use onecycle_link::{Axis, ControlLoop};
    use serde::de::IntoDeserializer;
    use serde::de::value::{Error as Refusal, MapDeserializer};

    use super::super::Against;
    use super::*;

    fn read(settings: &[(&'static str, &'static str)]) -> Result<Request, Refusal> {
        Request::deserialize(MapDeserializer::new(settings.iter().copied()))
    }

    // 45 degrees are pi/4; 10 % are 0.1.
    #[test]
    fn settings_are_typed() {
        let request = read(&[
            ("schema", SCHEMA),
            ("style", "calm"),
            ("phase_margin", "45"),
            ("noise", "10%"),
            ("axis", "yaw"),
            ("loop", "attitude"),
            ("against", "40,5,12"),
        ])
        .unwrap();
        let asked = &request.requirements;
        assert_eq!(asked.style, Style::Calm);
        assert_eq!(asked.phase_margin_rad, Some(std::f64::consts::FRAC_PI_4));
        assert_eq!(
            asked.against,
            Some(Against::Gains(Pid::new(40.0, 5.0, 12.0)))
        );
        assert_eq!(request.noise_share, Some(0.1));
        assert_eq!(request.loop_of_log(), ControlLoop::Attitude(Axis::Yaw));
        assert_eq!(read(&[]).unwrap(), Request::default());
    }

    #[test]
    fn values_are_numbers_texts_and_lists() {
        let of = |value: f64| {
            Text::deserialize(IntoDeserializer::<Refusal>::into_deserializer(value))
                .unwrap()
                .0
        };
        assert_eq!(of(0.001), Some("0.001".to_owned()));
        let list = vec![40.0, 0.0, 12.5].into_deserializer();
        let list: Result<_, Refusal> = Text::deserialize(list);
        assert_eq!(list.unwrap().0, Some("40,0,12.5".to_owned()));
        let of = |name: &'static str| {
            Request::deserialize(MapDeserializer::<_, Refusal>::new(
                [(name, false)].into_iter(),
            ))
        };
        assert_eq!(of("write").unwrap(), Request::default());
        assert!(of("design").unwrap().without_controllers);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (name, value, words) in [
            ("colour", "red", "no setting colour"),
            ("ms", "0.5", "`ms`: Ms lies between"),
            ("schema", "onecycle.request/9", "must be onecycle.request/1"),
            (
                "structure",
                "chaos",
                "`structure`: there is no such structure",
            ),
        ] {
            let sentence = read(&[(name, value)]).unwrap_err().to_string();
            assert!(sentence.contains(words), "{sentence}");
        }
    }
}
