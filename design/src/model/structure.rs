//! Structures of processes, and the parameters that describe them.

/// Structure of a process: its integrators, lags and dead time. [`Structure::transfer_function`] prints the formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Structure {
    /// Integrator with dead time.
    Iptd,
    /// Integrator with one lag and dead time: the rate of a vehicle whose body has no damping.
    IntegratorLag,
    /// Double integrator with one lag and dead time: angle or position of a vehicle without damping.
    DoubleIntegratorLag,
    /// Second order plus integrator plus dead time: an integrator with two lags and dead time.
    Soiptd,
    /// Integrator with three lags and dead time: [`Structure::Soiptd`] with a second actuator lag.
    Toiptd,
    /// First order plus dead time.
    Foptd,
    /// Second order plus dead time, two real lags: the rate of a damped vehicle.
    Soptd,
    /// Third order plus dead time, three real lags: the rate of a damped vehicle with a second lag, as that of a gyro's
    /// filter.
    Toptd,
    /// Second order with a resonance, or two slow lags, and dead time.
    Resonant,
    /// [`Structure::Resonant`] with an actuator lag.
    ResonantLag,
}

/// Number of stages of each kind in a process. The input passes the dead time, then the stages in the order of the
/// fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Stages {
    /// Lags `1/(T s + 1)` of the actuator: 0 to 2.
    pub lags: usize,
    /// Poles `1/(s + a)`: 0 or 1.
    pub poles: usize,
    /// Second-order stages `1/(s^2 + c1 s + c0)`: 0 or 1.
    pub pairs: usize,
    /// Integrators `1/s`: 0 to 2.
    pub integrators: usize,
}

impl Stages {
    /// Number of states of the stages.
    #[must_use]
    pub const fn states(self) -> usize {
        self.lags + self.behind_the_lags()
    }

    /// Number of states behind the actuator lags.
    #[must_use]
    pub const fn behind_the_lags(self) -> usize {
        self.poles + 2 * self.pairs + self.integrators
    }
}

impl Structure {
    /// Every structure.
    pub const ALL: [Self; 10] = [
        Self::Iptd,
        Self::IntegratorLag,
        Self::DoubleIntegratorLag,
        Self::Soiptd,
        Self::Toiptd,
        Self::Foptd,
        Self::Soptd,
        Self::Toptd,
        Self::Resonant,
        Self::ResonantLag,
    ];

    /// Name in JSON, on command lines and in packs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Iptd => "iptd",
            Self::IntegratorLag => "integrator_lag",
            Self::DoubleIntegratorLag => "double_integrator_lag",
            Self::Soiptd => "soiptd",
            Self::Toiptd => "toiptd",
            Self::Foptd => "foptd",
            Self::Soptd => "soptd",
            Self::Toptd => "toptd",
            Self::Resonant => "resonant",
            Self::ResonantLag => "resonant_lag",
        }
    }

    /// Structure of this [name](Self::name).
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|structure| structure.name() == name)
    }

    /// Number of stages of each kind.
    #[must_use]
    pub const fn stages(self) -> Stages {
        let (lags, poles, pairs, integrators) = match self {
            Self::Iptd => (0, 0, 0, 1),
            Self::IntegratorLag => (1, 0, 0, 1),
            Self::DoubleIntegratorLag => (1, 0, 0, 2),
            Self::Soiptd => (1, 1, 0, 1),
            Self::Toiptd => (2, 1, 0, 1),
            Self::Foptd => (0, 1, 0, 0),
            Self::Soptd => (1, 1, 0, 0),
            Self::Toptd => (2, 1, 0, 0),
            Self::Resonant => (0, 0, 1, 0),
            Self::ResonantLag => (1, 0, 1, 0),
        };
        Stages {
            lags,
            poles,
            pairs,
            integrators,
        }
    }

    /// Transfer function as text, in the symbols of [`Parameter::symbol_in`].
    #[must_use]
    pub fn transfer_function(self) -> &'static str {
        match self {
            Self::Iptd => "K e^(-tau s) / s",
            Self::IntegratorLag => "K e^(-tau s) / (s (T s + 1))",
            Self::DoubleIntegratorLag => "K/T_body e^(-tau s) / (s^2 (T_prop s + 1))",
            Self::Soiptd => "K e^(-tau s) / (s (T_prop s + 1)(T_body s + 1))",
            Self::Toiptd => "K e^(-tau s) / (s (T_prop s + 1)(T_prop2 s + 1)(T_body s + 1))",
            Self::Foptd => "K e^(-tau s) / (T s + 1)",
            Self::Soptd => "K e^(-tau s) / ((T1 s + 1)(T2 s + 1))",
            Self::Toptd => "K e^(-tau s) / ((T1 s + 1)(T2 s + 1)(T3 s + 1))",
            Self::Resonant => "K e^(-tau s) / (s^2/w0^2 + 2 zeta s/w0 + 1)",
            Self::ResonantLag => "K e^(-tau s) / ((T s + 1)(s^2/w0^2 + 2 zeta s/w0 + 1))",
        }
    }

    /// Parameters to report for this structure, in the order of a report.
    #[must_use]
    pub fn parameters(self) -> &'static [Parameter] {
        use Parameter::{K, KOverTBody, NaturalFrequency, TBody, TProp, TProp2, Tau, Zeta};
        match self {
            Self::Iptd => &[K, Tau],
            Self::IntegratorLag => &[K, TProp, Tau],
            Self::DoubleIntegratorLag => &[KOverTBody, TProp, Tau],
            Self::Soiptd => &[K, KOverTBody, TProp, TBody, Tau],
            Self::Soptd => &[K, KOverTBody, TBody, TProp, Tau],
            Self::Toiptd => &[K, KOverTBody, TProp, TProp2, TBody, Tau],
            Self::Toptd => &[K, KOverTBody, TBody, TProp, TProp2, Tau],
            Self::Foptd => &[K, KOverTBody, TBody, Tau],
            Self::Resonant => &[K, NaturalFrequency, Zeta, Tau],
            Self::ResonantLag => &[K, NaturalFrequency, Zeta, TProp, Tau],
        }
    }

    /// Unit of a parameter of this structure. The unit of a gain depends on the number of integrators.
    #[must_use]
    pub fn unit(self, parameter: Parameter) -> Unit {
        let integrators = self.stages().integrators;
        let gain = |seconds: usize| match seconds {
            0 => Unit::OutputPerInput,
            1 => Unit::OutputPerInputSecond,
            _ => Unit::OutputPerInputSecondSquared,
        };
        match parameter {
            Parameter::K => gain(integrators),
            // The gain in front of 1/(s + 1/T_body), or in front of the second integrator in its place.
            Parameter::KOverTBody => gain(integrators + self.stages().poles),
            Parameter::TProp | Parameter::TProp2 | Parameter::TBody | Parameter::Tau => {
                Unit::Second
            }
            Parameter::InverseTBody => Unit::PerSecond,
            Parameter::NaturalFrequency => Unit::RadianPerSecond,
            Parameter::Zeta => Unit::One,
            Parameter::InputBias => Unit::Input,
        }
    }
}

/// Physical parameter of a model, or of the experiment that identified it. For its unit see [`Structure::unit`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Parameter {
    /// Gain `K` of the transfer function. With an integrator: rate of the output per unit of input in steady state.
    /// Without one: output per unit of input in steady state. Infinite without damping.
    K,
    /// Gain `K/T_body` of the body. Finite without damping. With an integrator: acceleration per unit of input.
    KOverTBody,
    /// Actuator lag `T_prop`, the shorter of two lags.
    TProp,
    /// Second, shorter actuator lag `T_prop2`.
    TProp2,
    /// Body lag `T_body`, the longest lag. Infinite without damping.
    TBody,
    /// Damping `1/T_body`. Zero for a double integrator.
    InverseTBody,
    /// Natural frequency `w0` of the resonance.
    NaturalFrequency,
    /// Damping ratio `zeta` of the resonance. Above 1 there are two real lags.
    Zeta,
    /// Dead time `tau`.
    Tau,
    /// Constant disturbance at the process input, which the recording does not show.
    InputBias,
}

/// Unit of a parameter, in terms of the units of the recorded input and output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Unit {
    /// Output unit / input unit.
    OutputPerInput,
    /// Output unit / (input unit s).
    OutputPerInputSecond,
    /// Output unit / (input unit s^2).
    OutputPerInputSecondSquared,
    /// s.
    Second,
    /// 1/s.
    PerSecond,
    /// rad/s.
    RadianPerSecond,
    /// Without unit.
    One,
    /// Input unit.
    Input,
}

impl Parameter {
    /// Key in JSON. It ends in the unit where the unit is one of time: `tau_s`.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::K => "k",
            Self::KOverTBody => "k_over_t_body",
            Self::TProp => "t_prop_s",
            Self::TProp2 => "t_prop2_s",
            Self::TBody => "t_body_s",
            Self::InverseTBody => "inv_t_body_per_s",
            Self::NaturalFrequency => "natural_frequency_rad_per_s",
            Self::Zeta => "zeta",
            Self::Tau => "tau_s",
            Self::InputBias => "input_bias",
        }
    }

    /// Symbol in a process of `structure`. One that comes to rest, or has a single lag behind an integrator, is no body with its actuator:
    /// its lags are `T`, or `T1` to `T3` from the longest.
    #[must_use]
    pub fn symbol_in(self, structure: Structure) -> &'static str {
        use Structure::{Foptd, IntegratorLag, ResonantLag, Soptd, Toptd};
        match (structure, self) {
            (Foptd, Self::TBody) | (IntegratorLag | ResonantLag, Self::TProp) => "T",
            (Foptd, Self::KOverTBody) => "K/T",
            (Soptd | Toptd, Self::TBody) => "T1",
            (Soptd | Toptd, Self::KOverTBody) => "K/T1",
            (Soptd | Toptd, Self::TProp) => "T2",
            (Toptd, Self::TProp2) => "T3",
            _ => self.symbol(),
        }
    }

    /// Symbol in [`Structure::transfer_function`].
    #[must_use]
    pub fn symbol(self) -> &'static str {
        match self {
            Self::K => "K",
            Self::KOverTBody => "K/T_body",
            Self::TProp => "T_prop",
            Self::TProp2 => "T_prop2",
            Self::TBody => "T_body",
            Self::InverseTBody => "1/T_body",
            Self::NaturalFrequency => "w0",
            Self::Zeta => "zeta",
            Self::Tau => "tau",
            Self::InputBias => "input bias",
        }
    }
}
