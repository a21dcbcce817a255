#include "media/vital_codes.h"

#include <algorithm>
#include <array>

namespace kiroku::media {
namespace {

// IEEE 11073-10101 annex A, partition 2 (SCADA): the numeric code is 2 * 65536 + term.
constexpr std::array<VitalCode, 16> kCodes{{
    {kFlashCode, 0, "1", "picture flash"},
    {"MDC_AWAY_CO2_ET", 151728, "mm[Hg]", "end-tidal carbon dioxide"},
    {"MDC_ECG_ELEC_POTL_II", 131330, "mV", "ECG lead II"},
    {"MDC_ECG_HEART_RATE", 147842, "/min", "heart rate"},
    {"MDC_PRESS_BLD_ART_ABP_DIA", 150038, "mm[Hg]", "arterial pressure, diastolic"},
    {"MDC_PRESS_BLD_ART_ABP_MEAN", 150039, "mm[Hg]", "arterial pressure, mean"},
    {"MDC_PRESS_BLD_ART_ABP_SYS", 150037, "mm[Hg]", "arterial pressure, systolic"},
    {"MDC_PRESS_BLD_NONINV_DIA", 150022, "mm[Hg]", "cuff pressure, diastolic"},
    {"MDC_PRESS_BLD_NONINV_MEAN", 150023, "mm[Hg]", "cuff pressure, mean"},
    {"MDC_PRESS_BLD_NONINV_SYS", 150021, "mm[Hg]", "cuff pressure, systolic"},
    {"MDC_PULS_OXIM_PLETH", 150452, "1", "plethysmogram"},
    {"MDC_PULS_OXIM_PULS_RATE", 149530, "/min", "pulse rate"},
    {"MDC_PULS_OXIM_SAT_O2", 150456, "%", "oxygen saturation"},
    {"MDC_RESP_RATE", 151562, "/min", "respiration rate"},
    {"MDC_TEMP_BODY", 150364, "Cel", "body temperature"},
    {"MDC_TTHOR_RESP_RATE", 151578, "/min", "respiration rate, transthoracic"},
}};
static_assert(std::ranges::is_sorted(kCodes, {}, &VitalCode::code));

}  // namespace

std::span<const VitalCode> vital_codes() { return kCodes; }

const VitalCode* find_vital_code(std::string_view code) {
  const auto* const found = std::ranges::lower_bound(kCodes, code, {}, &VitalCode::code);
  return found != kCodes.end() && found->code == code ? found : nullptr;
}

}  // namespace kiroku::media
