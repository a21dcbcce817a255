// A plausible anaesthetised adult, for demonstrations and tests. Never to be taken for a person: every
// sample's source is "synthetic:patient".
//
// The same seed gives the same samples to the last bit (with the same binary). Endless.
//
// Models, all with the heart's phase in common:
//   heart rate   72 /min, with respiratory sinus arrhythmia at the breathing rate, a Mayer wave at 0.1 Hz (as
//                in McSharry 2003, section III-A) and a slow wander (Ornstein-Uhlenbeck, 90 s)
//   ECG lead II  McSharry, Clifford, Tarassenko, Smith: A dynamical model for generating synthetic
//                electrocardiogram signals. IEEE Trans Biomed Eng 50(3):289-294, 2003, equation 1 with the
//                parameters of table I, on its limit cycle; the angle is that of the heart's phase
//   arterial     two-element windkessel (Frank 1899; Westerhof, Lankhaar, Westerhof: The arterial Windkessel.
//     pressure   Med Biol Eng Comput 47:131-141, 2009): C dP/dt = Q - P / R, ejection Q a half sine of 0.3 s
//   pleth        two Gaussian waves a beat, systolic and diastolic, behind the heart by the pulse transit
//   others       constants with a slow wander in their clinical range
#pragma once

#include <memory>

#include "recorder/vitals/vital_source.h"

namespace kiroku::recorder {

/// Opens `synthetic:patient`. Options: `seed=N` (1), `flash=N` (a sample KIROKU_FLASH of value 1 at each
/// whole multiple of N seconds of the case clock, 0 included, for tests of synchronism; 0: never), `waves=0`
/// (no waveforms), `speed=max`.
///
/// Each second: heart rate, pulse rate, oxygen saturation, arterial pressure, respiration rate, end-tidal
/// CO2; every 10 s temperature; every 3 min from second 10 on cuff pressure. Every 0.4 s a block of ECG lead
/// II (250 Hz, mV) and of the plethysmogram (125 Hz, 0 to 1).
std::unique_ptr<VitalSource> open_synthetic_patient(const SourceAddress& address);

}  // namespace kiroku::recorder
