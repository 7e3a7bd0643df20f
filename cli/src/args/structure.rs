//! A process of any structure by its name and the names of its parameters.

use clap::Args;
use onecycle_design::{Linear, Model, Parameter, Structure};

use super::ProcessArguments;
use crate::failure::Failure;

/// Structure and parameters of a process.
#[derive(Clone, Debug, Args)]
pub(crate) struct StructureArguments {
    /// Structure of the process, alone or with its parameters: FOPTD,K=2,T=10,tau=1
    #[arg(long, value_name = "NAME[,K=..]", default_value = "soiptd", value_parser = process)]
    process: Process,
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
    Structure::from_name(&name.trim().to_lowercase().replace('-', "_")).ok_or_else(|| {
        let names = Structure::ALL.map(Structure::name).join(", ");
        format!("there is no structure '{name}': choose from {names}")
    })
}

/// A structure with the parameters that were written behind it.
#[derive(Clone, Debug)]
struct Process {
    structure: Structure,
    values: Vec<(Parameter, f64)>,
}

/// A structure and its parameters: `FOPTD,K=2,T=10,tau=1`.
fn process(text: &str) -> Result<Process, String> {
    let mut parts = text.split(',');
    let structure = structure(parts.next().unwrap_or_default())?;
    let mut values: Vec<(Parameter, f64)> = vec![];
    for part in parts {
        let (name, value) = (part.split_once('=')).ok_or_else(|| {
            format!("'{part}' is not a parameter: write K=2, separated by commas")
        })?;
        let parameter = parameter(structure, name)?;
        let value = (value.trim().parse()).map_err(|_| {
            format!(
                "'{value}' is not a number for {}",
                parameter.symbol_in(structure)
            )
        })?;
        if values.iter().any(|(known, _)| *known == parameter) {
            return Err(format!("{} is given twice", parameter.symbol_in(structure)));
        }
        values.push((parameter, value));
    }
    Ok(Process { structure, values })
}

/// A parameter by its symbol or its key without the unit. `T` is the only or the longest lag of the structure.
fn parameter(structure: Structure, name: &str) -> Result<Parameter, String> {
    let name = name.trim().to_lowercase().replace('-', "_");
    let own = structure.parameters();
    if name == "t" {
        let lags = [Parameter::TBody, Parameter::TProp];
        if let Some(lag) = lags.into_iter().find(|lag| own.contains(lag)) {
            return Ok(lag);
        }
    }
    let is_named = |parameter: &&Parameter| {
        let option = name_of(**parameter);
        let symbols = [parameter.symbol(), parameter.symbol_in(structure)];
        symbols.map(str::to_lowercase).contains(&name) || name == option
    };
    own.iter().find(is_named).copied().ok_or_else(|| {
        let symbols: Vec<_> = own
            .iter()
            .map(|parameter| parameter.symbol_in(structure))
            .collect();
        format!(
            "'{name}' is not a parameter of {}, which has {}",
            structure.name(),
            symbols.join(", ")
        )
    })
}

/// Name of the option of a parameter, with `_` between its words.
fn name_of(parameter: Parameter) -> String {
    let option = OPTIONS.iter().find(|(known, _)| *known == parameter);
    option.map_or(String::new(), |(_, option)| {
        option.trim_start_matches('-').replace('-', "_")
    })
}

impl StructureArguments {
    fn value(&self, parameter: Parameter) -> Option<f64> {
        let written = self.process.values.iter();
        let behind = written.filter(|(known, _)| *known == parameter);
        self.option(parameter)
            .or(behind.map(|(_, value)| *value).next())
    }

    fn option(&self, parameter: Parameter) -> Option<f64> {
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
        let structure = self.process.structure;
        if structure == Structure::Soiptd {
            let process = ProcessArguments {
                k: self.value(Parameter::K),
                k_over_t_body: self.value(Parameter::KOverTBody),
                t_prop: self.value(Parameter::TProp).unwrap_or(f64::NAN),
                t_body: self.value(Parameter::TBody).unwrap_or(f64::NAN),
                tau: self.value(Parameter::Tau).unwrap_or(f64::NAN),
            };
            return process.process().map(Model::from);
        }
        Linear::from_parameters(structure, |parameter| self.value(parameter))
            .map(Model::from)
            .map_err(Failure::usage)
    }

    /// Whether every parameter is there, and no other.
    fn check_names(&self) -> Result<(), Failure> {
        let structure = self.process.structure;
        let (name, parameters) = (structure.name(), structure.parameters());
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
            let is_behind = |(known, _): &(Parameter, f64)| *known == parameter;
            if self.option(parameter).is_some() && self.process.values.iter().any(is_behind) {
                return Err(Failure::usage(format!(
                    "{} is given by {option} and by --process: leave one out",
                    parameter.symbol()
                )));
            }
            if given && !has {
                return Err(Failure::usage(format!(
                    "{option} is not a parameter of the process {name}, which has {}",
                    list()
                )));
            }
            if has && !given && !gains.contains(&parameter) {
                let is_default = structure == Structure::Soiptd && self.process.values.is_empty();
                let other = match is_default {
                    true => "; for one lag and a dead time add --process foptd",
                    false => "",
                };
                return Err(Failure::usage(format!(
                    "the process {name} needs {option}; its parameters are {}{other}",
                    list()
                )));
            }
        }
        if gains.iter().all(|gain| self.value(*gain).is_some()) {
            return Err(Failure::usage(format!(
                "the gain is given twice: give either K or {}",
                Parameter::KOverTBody.symbol_in(structure)
            )));
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
