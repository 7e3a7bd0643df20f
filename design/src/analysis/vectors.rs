//! Processes with their optimal controllers, from an independent implementation (Python 3, numpy, scipy, mpmath).
//!
//! Each row is the controller of least IAE of a unit load step (PD: reference step) with `Ms` and `Mt` at most `m`. The
//! gains are rounded to six digits; the figures are those of the rounded gains. IAE and ISE come from an integration by
//! the method of steps (DOP853, relative tolerance 1e-10), `Ms` from 30-digit arithmetic.

use crate::controller::{Execution, Form};

use super::process::{Process, Stage};
use Stage::{Lag, Pair, Pole};

pub(crate) struct Vector {
    pub stages: &'static [Stage],
    pub tau_s: f64,
    pub form: Form,
    pub m: f64,
    /// `kp`, `ki`, `kd`.
    pub gains: [f64; 3],
    pub filter_s: f64,
    /// IAE, ISE.
    pub integrals: [f64; 2],
    /// `Ms`, `Mt`.
    pub peaks: [f64; 2],
    /// Phase margin (deg), gain margin, delay margin (s).
    pub margins: [f64; 3],
}

impl Vector {
    pub(crate) fn process(&self) -> Process {
        Process::of_stages(1.0, self.stages, self.tau_s, &Execution::default()).unwrap()
    }
}

#[rustfmt::skip]
pub(crate) const VECTORS: [Vector; 22] = [
    // 0: FOPTD K1 T1 tau1, PI
    Vector { stages: &[Lag(1.0)], tau_s: 1.0, form: Form::Pi, m: 1.6, gains: [0.526949, 0.501322, 0.0], filter_s: 0.0,
        integrals: [1.9965702613072847, 1.0489121209876933], peaks: [1.6000001248478473, 0.9999999999975823], margins: [62.13886374868615, 3.0644403510305844, 2.1405343435376993] },
    // 1: FOPTD K1 T1 tau1, PID
    Vector { stages: &[Lag(1.0)], tau_s: 1.0, form: Form::Pid, m: 1.6, gains: [0.83657, 0.793449, 0.316496], filter_s: 0.05,
        integrals: [1.4848167415750668, 0.6439555545242373], peaks: [1.5999994708584744, 1.089558165360625], margins: [55.10375652778865, 2.7231093658239662, 1.3573991325593364] },
    // 2: FOPTD K1 T10 tau1, PI
    Vector { stages: &[Lag(10.0)], tau_s: 1.0, form: Form::Pi, m: 1.4, gains: [3.11008, 0.687147, 0.0], filter_s: 0.0,
        integrals: [1.5208814472555354, 0.22007271452621996], peaks: [1.4000002862191974, 1.1998368007110713], margins: [53.54865482157096, 4.751768162194788, 2.647518216830149] },
    // 3: FOPTD K1 T10 tau1, PID
    Vector { stages: &[Lag(10.0)], tau_s: 1.0, form: Form::Pid, m: 1.6, gains: [6.19285, 2.65172, 2.77843], filter_s: 0.05,
        integrals: [0.5303737327773883, 0.04366451422140722], peaks: [1.6000023880996126, 1.5844952652959363], margins: [39.48228702754706, 2.769625126280004, 1.0575749327133515] },
    // 4: FOPTD K1 T.1 tau1, PI
    Vector { stages: &[Lag(0.1)], tau_s: 1.0, form: Form::Pi, m: 1.6, gains: [0.207197, 0.579446, 0.0], filter_s: 0.0,
        integrals: [1.7257863545524519, 1.3326157023631326], peaks: [1.6000000248124748, 0.9999999999828176], margins: [64.67903045344006, 2.8563607975560776, 1.9093750289010347] },
    // 5: int K1 tau1, PI
    Vector { stages: &[Pole(0.0)], tau_s: 1.0, form: Form::Pi, m: 1.4, gains: [0.299993, 0.0407262, 0.0], filter_s: 0.0,
        integrals: [25.84116123018372, 48.70021088263718], peaks: [1.4000000194984121, 1.3931660000769197], margins: [48.70840934882666, 4.910414299092474, 2.6149657283436136] },
    // 6: int K1 tau1, PI
    Vector { stages: &[Pole(0.0)], tau_s: 1.0, form: Form::Pi, m: 1.6, gains: [0.400623, 0.0699395, 0.0], filter_s: 0.0,
        integrals: [14.767896586590691, 22.82416702378636], peaks: [1.5999998915394482, 1.4649339960659653], margins: [43.24297221196461, 3.5960818790621505, 1.746714863692577] },
    // 7: int K1 tau1, PI
    Vector { stages: &[Pole(0.0)], tau_s: 1.0, form: Form::Pi, m: 2.0, gains: [0.545233, 0.124234, 0.0], filter_s: 0.0,
        integrals: [8.07655055685413, 10.739910999223516], peaks: [2.0000001395311804, 1.6681862467456054], margins: [35.19847983840089, 2.5541479072972706, 1.049927951656993] },
    // 8: int K1 tau1, PID
    Vector { stages: &[Pole(0.0)], tau_s: 1.0, form: Form::Pid, m: 1.6, gains: [0.598782, 0.178334, 0.262747], filter_s: 0.05,
        integrals: [7.02705081794022, 6.98108598647461], peaks: [1.5999992611042901, 1.6000025201734012], margins: [40.88333048669325, 2.7895363449954784, 1.1645185914290317] },
    // 9: int1 K1 T.7 tau.3, PID
    Vector { stages: &[Lag(0.7), Pole(0.0)], tau_s: 0.3, form: Form::Pid, m: 1.6, gains: [1.79931, 0.978871, 1.01405], filter_s: 0.015,
        integrals: [1.3113781366811545, 0.44165991936014704], peaks: [1.5999984441915955, 1.5999975482999143], margins: [42.08633580412352, 3.3197502569225783, 0.5301567472875248] },
    // 10: int2 K1 Tp.0321 Tb1.6886 tau.0237, PID
    Vector { stages: &[Lag(0.0321), Lag(1.6886), Pole(0.0)], tau_s: 0.0237, form: Form::Pid, m: 1.4, gains: [26.6838, 32.2974, 10.7368], filter_s: 0.0019875,
        integrals: [0.03505132901500227, 0.0007310613364899385], peaks: [1.3999992009627376, 1.4000022890352768], margins: [51.56496186317964, 6.316117897425326, 0.14427383225933144] },
    // 11: int2 K1 Tp.0321 Tb1.6886 tau.0237, PID
    Vector { stages: &[Lag(0.0321), Lag(1.6886), Pole(0.0)], tau_s: 0.0237, form: Form::Pid, m: 1.6, gains: [47.6865, 93.8186, 13.9473], filter_s: 0.0019875,
        integrals: [0.013280830733544646, 0.00015517710388661025], peaks: [1.5999997846489158, 1.6000012310963911], margins: [42.55000371797425, 4.671141747376387, 0.09381065291134756] },
    // 12: int2 K1 Tp.0321 Tb1.6886 tau.0237, PID
    Vector { stages: &[Lag(0.0321), Lag(1.6886), Pole(0.0)], tau_s: 0.0237, form: Form::Pid, m: 2.0, gains: [86.67, 279.005, 18.6955], filter_s: 0.0019875,
        integrals: [0.005137465051636446, 3.328215612711765e-05], peaks: [2.000000019373512, 1.9399184276605583], margins: [32.234998711351714, 3.297372417985324, 0.05523128630271915] },
    // 13: rate K1 T1.0321 T2 1.6886 tau.0237, PI
    Vector { stages: &[Lag(0.0321), Lag(1.6886)], tau_s: 0.0237, form: Form::Pi, m: 1.6, gains: [14.0581, 51.38, 0.0], filter_s: 0.0,
        integrals: [0.019481848988203862, 0.0008300051075379532], peaks: [1.6000003429281688, 1.4086372671589007], margins: [43.711383052216085, 4.911986342876932, 0.0878795008940061] },
    // 14: rate K1 T1.0321 T2 1.6886 tau.0237, PID
    Vector { stages: &[Lag(0.0321), Lag(1.6886)], tau_s: 0.0237, form: Form::Pid, m: 1.6, gains: [35.7431, 306.452, 1.12791], filter_s: 0.001185,
        integrals: [0.004371058255033634, 7.077395030717538e-05], peaks: [1.5999994817207923, 1.599998210062758], margins: [41.56333589277393, 3.144492919604648, 0.03954631717397314] },
    // 15: SOPTD w1 zeta.5 tau.5, PID
    Vector { stages: &[Pair(1.0, 1.0)], tau_s: 0.5, form: Form::Pid, m: 1.6, gains: [0.988764, 0.767655, 0.866643], filter_s: 0.025,
        integrals: [1.3840463295052887, 0.5571027816097004], peaks: [1.600000010840195, 0.9999999999760096], margins: [66.02166887018376, 3.255581688558464, 1.1610820019332713] },
    // 16: 1/(s+1)^4, PI
    Vector { stages: &[Lag(1.0); 4], tau_s: 0.0, form: Form::Pi, m: 1.4, gains: [0.432613, 0.191968, 0.0], filter_s: 0.0,
        integrals: [5.2092015335889315, 2.474066753269204], peaks: [1.3999993676198557, 0.9999999999720601], margins: [69.63120199274695, 5.0469790003260755, 6.245123686374192] },
    // 17: 1/(s+1)^4, PID
    Vector { stages: &[Lag(1.0); 4], tau_s: 0.0, form: Form::Pid, m: 1.6, gains: [1.66779, 0.722113, 2.12434], filter_s: 0.074989,
        integrals: [1.7567758140126286, 0.43323173762648326], peaks: [1.6000005775110386, 1.109933964570087], margins: [57.619258317151065, 3.894242482744362, 1.8515497318319414] },
    // 18: int2 K1 Tp.0321 Tb1.6886 tau.0237, PID-series
    Vector { stages: &[Lag(0.0321), Lag(1.6886), Pole(0.0)], tau_s: 0.0237, form: Form::CascadePi, m: 1.6, gains: [47.6323, 47.333, 11.9834], filter_s: 0.0019875,
        integrals: [0.021126909344432294, 0.00026688669526006765], peaks: [1.599999775810571, 1.5999974888390118], margins: [40.254334492332795, 5.271117014441601, 0.09517099162397553] },
    // 19: int2 K1 Tp.0321 Tb1.6886 tau.0237, PD
    Vector { stages: &[Lag(0.0321), Lag(1.6886), Pole(0.0)], tau_s: 0.0237, form: Form::Pd, m: 1.6, gains: [48.2582, 0.0, 12.7005], filter_s: 0.0019875,
        integrals: [0.2955505713314161, 0.22016324913925778], peaks: [1.5999997058792592, 1.4508063421725947], margins: [42.61791285014678, 4.998266299719104, 0.09257779460748108] },
    // 20: SOPTD T1 1 T2 .2 tau.1, PID
    Vector { stages: &[Lag(1.0), Lag(0.2)], tau_s: 0.1, form: Form::Pid, m: 1.6, gains: [6.02692, 13.3585, 0.91851], filter_s: 0.005,
        integrals: [0.09589473087461067, 0.008634886445635708], peaks: [1.5999994394213715, 1.4369895435194073], margins: [44.428430689424246, 3.227265050357128, 0.1738176288830037] },
    // 21: SOPTD T1 1 T2 .2 tau.1, PI
    Vector { stages: &[Lag(1.0), Lag(0.2)], tau_s: 0.1, form: Form::Pi, m: 2.0, gains: [3.12583, 4.12228, 0.0], filter_s: 0.0,
        integrals: [0.24389701901891783, 0.04415024588118492], peaks: [2.0000009244851813, 1.524147679137737], margins: [38.75391959609534, 3.1737257167203974, 0.2390228191443227] },
];
