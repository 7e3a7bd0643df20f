//! A process of any structure by its name and the names of its parameters.

use clap::Args;
use onecycle_design::{Linear, Model, Parameter, Structure};

use super::ProcessArguments;
use crate::failure::Failure;

/// Structure and parameters of a process.
#[derive(Clone, Debug, Args)]
pub(crate) struct StructureArguments {
    /// Structure of the process; --help lists structures and their parameters
    #[arg(long, value_name = "NAME", default_value = "soiptd", value_parser = structure)]
    process: Structure,
    /// Gain K: output unit / (input unit s) with an integrator, output unit / input unit without
    #[arg(
        long,
        value_name = "GAIN",
        allow_negative_numbers = true,
        conflicts_with = "k_over_t_body"
    )]
    k: Option<f64>,
    /// Gain K/T_body, instead of K
    #[arg(long, value_name = "GAIN", allow_negative_numbers = true)]
    k_over_t_body: Option<f64>,
    /// Time constant of the actuator, in seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    t_prop: Option<f64>,
    /// Second time constant of the actuator, in seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    t_prop2: Option<f64>,
    /// Time constant of the body, in seconds; inf for no damping (then use --k-over-t-body)
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    t_body: Option<f64>,
    /// Natural frequency of a resonance, in rad/s
    #[arg(long, value_name = "RAD/S", allow_negative_numbers = true)]
    natural_frequency: Option<f64>,
    /// Damping ratio of a resonance
    #[arg(long, value_name = "ZETA", allow_negative_numbers = true)]
    zeta: Option<f64>,
    /// Dead time, in seconds
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    tau: Option<f64>,
}

/// Parameters that a process may have, with their options.
const OPTIONS: [(Parameter, &str); 8] = [
    (Parameter::K, "--k"),
    (Parameter::KOverTBody, "--k-over-t-body"),
    (Parameter::TProp, "--t-prop"),
    (Parameter::TProp2, "--t-prop2"),
    (Parameter::TBody, "--t-body"),
    (Parameter::NaturalFrequency, "--natural-frequency"),
    (Parameter::Zeta, "--zeta"),
    (Parameter::Tau, "--tau"),
];

/// A structure by its name, with `-` or `_` between its words.
fn structure(name: &str) -> Result<Structure, String> {
    Structure::from_name(&name.replace('-', "_")).ok_or_else(|| {
        let names = Structure::ALL.map(Structure::name).join(", ");
        format!("there is no structure '{name}': choose from {names}")
    })
}

impl StructureArguments {
    fn value(&self, parameter: Parameter) -> Option<f64> {
        match parameter {
            Parameter::K => self.k,
            Parameter::KOverTBody => self.k_over_t_body,
            Parameter::TProp => self.t_prop,
            Parameter::TProp2 => self.t_prop2,
            Parameter::TBody => self.t_body,
            Parameter::NaturalFrequency => self.natural_frequency,
            Parameter::Zeta => self.zeta,
            Parameter::Tau => self.tau,
            _ => None,
        }
    }

    /// The process. An integrator with two lags is checked as `tune` checks it.
    pub(crate) fn model(&self) -> Result<Model, Failure> {
        self.check_names()?;
        if self.process == Structure::Soiptd {
            let process = ProcessArguments {
                k: self.k,
                k_over_t_body: self.k_over_t_body,
                t_prop: self.t_prop.unwrap_or(f64::NAN),
                t_body: self.t_body.unwrap_or(f64::NAN),
                tau: self.tau.unwrap_or(f64::NAN),
            };
            return process.process().map(Model::from);
        }
        Linear::from_parameters(self.process, |parameter| self.value(parameter))
            .map(Model::from)
            .map_err(Failure::usage)
    }

    /// Whether every parameter is there, and no other.
    fn check_names(&self) -> Result<(), Failure> {
        let (name, parameters) = (self.process.name(), self.process.parameters());
        let list = || {
            let own = OPTIONS
                .iter()
                .filter(|(parameter, _)| parameters.contains(parameter));
            own.map(|(_, option)| *option)
                .collect::<Vec<_>>()
                .join(", ")
        };
        let gains = [Parameter::K, Parameter::KOverTBody];
        for (parameter, option) in OPTIONS {
            let (has, given) = (
                parameters.contains(&parameter),
                self.value(parameter).is_some(),
            );
            if given && !has {
                return Err(Failure::usage(format!(
                    "{option} is not a parameter of the process {name}, which has {}",
                    list()
                )));
            }
            if has && !given && !gains.contains(&parameter) {
                return Err(Failure::usage(format!(
                    "the process {name} needs {option}; its parameters are {}",
                    list()
                )));
            }
        }
        if gains.iter().all(|gain| self.value(*gain).is_none()) {
            let own = OPTIONS
                .iter()
                .filter(|(p, _)| gains.contains(p) && parameters.contains(p));
            let own: Vec<_> = own.map(|(_, option)| *option).collect();
            return Err(Failure::usage(format!(
                "the process {name} needs its gain: {}",
                own.join(" or ")
            )));
        }
        Ok(())
    }
}
