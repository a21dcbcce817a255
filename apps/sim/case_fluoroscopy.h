// The fluoroscopy of a recorded case as radiographs, as 'kiroku respire serve --case' takes it. Functions.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "apps/kiroku/home.h"
#include "archive/reading/case_reader.h"
#include "viewer/breathing/breathing_bench.h"

namespace kiroku::apps {

struct CaseFluoroscopyRequest {
  std::string named;                            // the case, as find_case() takes it
  std::optional<std::string> stream, from, to;  // nothing: the only one of that purpose, all of it
  std::optional<std::string> polarity;          // "bone-black" if absent, as a fluoroscope shows it
  double most_a_second = 5;                     // pictures that are taken
  std::vector<std::string> identities;          // files; none: a demonstration home's own
  std::string stream_option = "--stream";       // by which the stream is asked for
};

struct CaseFluoroscopy {
  viewer::BenchRecording recording;
  std::vector<viewer::BenchRadiograph> radiographs;  // by their times on the case clock, from the first on
  std::size_t pictures = 0;                          // that lie in the stretch; not all are taken
};

/// Which stream of which case is asked for.
struct FoundFluoroscopy {
  archive::CaseReader recording;
  std::string stream;
};

/// Decrypts nothing and enters nothing into a log. kiroku::UsageError for a case that this home's archive
/// does not have, and for a stream that is not there.
FoundFluoroscopy find_case_fluoroscopy(const Home& home, const CaseFluoroscopyRequest& request);

/// Decrypts the pictures and has each segment compared with the ledger's hash; whether the case holds is not
/// looked at. Enters the access into the appliance log. kiroku::UsageError for a time or identity that
/// is not there, and where the stretch holds no picture; kiroku::Error for a segment that is
/// not what the ledger states, and as BreathingBench::require_memory_for().
CaseFluoroscopy read_case_fluoroscopy(const Home& home, const FoundFluoroscopy& found,
                                      const CaseFluoroscopyRequest& request);

/// The home's document that says how the fluoroscope of a stream sees the patient: STREAM.geometry.json. It
/// tells where the C-arm is set up, not where it was in one case. kiroku::UsageError where there is none.
std::filesystem::path geometry_beside(const Home& home, const std::string& stream);

}  // namespace kiroku::apps
