// Messages of several monitors on their way into a vitals stream: each is kept as it came, read, answered,
// and known again when it is sent twice. An object belongs to one thread.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/tally.h"
#include "crypto/hash.h"
#include "media/vital_line.h"
#include "recorder/vitals/assumed_zone.h"
#include "recorder/vitals/hl7_patient_part.h"
#include "recorder/vitals/message_memory.h"
#include "recorder/vitals/monitor_reader.h"
#include "recorder/vitals/patient_watch.h"
#include "recorder/vitals/sender_list.h"

namespace kiroku::recorder {

/// "+0530", "+05:30", "UTC" or "local" (this machine's zone). Throws kiroku::UsageError naming `source`
/// for anything else.
AssumedZone parse_assumed_zone(const std::string& text, const std::string& source);

/// The acknowledgement of a message (ACK, HL7 v2 chapter 2.9.2, original mode): MSA-2 is its MSH-10.
/// `message` may be null where none could be read. "" where the sender asks for none (MSH-15 and MSH-16 are
/// both NE). `code` is AA, AE or AR; `text` is for people.
std::string make_acknowledgement(const Hl7Message* message, std::string_view code, std::string_view text,
                                 UtcTime now);

class Hl7Vitals {
 public:
  /// Messages of senders that `senders` does not take are answered with AR and recorded as a notice, ever
  /// more rarely for one sender; nothing of what they say is. What is of no place that `places` takes is
  /// acknowledged, so that its sender goes on, and not recorded either.
  explicit Hl7Vitals(const AssumedZone& assumed_zone, SenderList senders = {}, PlaceList places = {})
      : assumed_zone_(assumed_zone), senders_(std::move(senders)), places_(std::move(places)) {}

  /// Told of each patient whose values are taken; null: nobody. Before the first message.
  void hear_patients(std::shared_ptr<PatientWatch> watch) { watch_ = std::move(watch); }

  /// As VitalSource::case_begins(). From any thread.
  void case_begins(std::int64_t begins_ns) { begins_ns_ = begins_ns; }

  struct Taken {
    /// The message itself first, unless it is of another place, too; then what was read from it; all stamped
    /// with the arrival.
    std::vector<media::VitalLine> lines;
    /// "AA" taken (also if it came before, or is of another place), "AE" not readable, "AR" not of a kind
    /// that is recorded.
    std::string answer;
    std::string acknowledgement;  // without framing; "" if none is wanted
    bool is_of_sender = false;    // HL7 of somebody who may send here, taken or not
  };
  /// `peer` is who brought it, "" for a file: the source of its lines is "<MSH-3, MSH-4>[<place>]@<peer>",
  /// where the message names a place (PatientPart); "[<place> #2]" for the second patient that this sender
  /// spoke of there. `arrival_ns` must not decrease.
  ///
  /// Where other than the last message's bed or patient is spoken of, a notice says so, at most one each
  /// kMixtureEveryNs: "several-beds", unless `places` says which ones belong here, and "several-patients".
  /// What they are called is in none.
  ///
  /// A message is repeated if one of the last kRemembered had its sender, its MSH-10 and every byte of it: an
  /// identifier alone does not suffice, monitors begin anew with 1 or always send the same. It is not kept
  /// again. It is sent again with another time if all is the same but MSH-7, within kLongestRetryNs, and its
  /// sender is one whose identifiers tell messages apart: it has used several, and none for two contents.
  /// Then the message itself is kept, its values are not read again. From any other sender that is a new
  /// message with the same values.
  Taken take(std::string_view bytes, std::int64_t arrival_ns, UtcTime now, const std::string& peer);

  /// Messages of such senders so far. From any thread.
  [[nodiscard]] std::uint64_t refused() const { return strangers_.total(); }
  /// Messages that were of other places, or of none, so far, in whole or in part. From any thread.
  [[nodiscard]] std::uint64_t elsewhere() const { return elsewhere_.total() + unplaced_.total(); }

  static constexpr std::size_t kRemembered = MessageMemory::kRemembered;
  static constexpr std::int64_t kLongestRetryNs = 600'000'000'000;
  static constexpr std::size_t kMostSenders = 256;
  static constexpr std::size_t kMostPatients = 64;  // of one message, and told apart at one place
  static constexpr std::int64_t kMixtureEveryNs = 60'000'000'000;
  /// Messages of one peer that are none of HL7 are kept up to so many, then ever fewer (base/tally.h).
  static constexpr std::uint64_t kUnreadableKept = 1000;

 private:
  enum class Novelty { kNew, kRepeated, kRepeatedWithOtherTime };
  Novelty novelty_of(const std::string& source, const Hl7Message& message, std::string_view bytes,
                     std::int64_t arrival_ns);
  /// Who a message is about, as far as it must be known again; never told.
  struct PatientKey {
    std::optional<crypto::Sha256Digest> number, issuer;  // PID-3.1, PID-3.4
    /// Two devices may leave out different things: only what both state can differ.
    [[nodiscard]] bool differs(const PatientKey& other) const;
  };
  /// Whether the latest of two kinds took turns, and when that was told.
  struct Mixture {
    bool untold = false;
    std::optional<std::int64_t> told_ns;
  };
  void note_mixture(Mixture& mixture, const char* name, const char* text, const std::string& source,
                    std::int64_t arrival_ns, std::vector<media::VitalLine>& lines);
  void note_mixtures(const PatientPart& part, const std::string& source, std::int64_t arrival_ns,
                     std::vector<media::VitalLine>& lines);
  /// What stands between sender and peer in the source of its lines.
  std::string mark_of(const PatientPart& part, const std::string& sender);
  /// Of the message's parts those that are taken; counts the others, and tells of them.
  std::vector<PatientPart> parts_of_here(std::vector<PatientPart> parts, const std::string& source,
                                         std::int64_t arrival_ns, std::vector<media::VitalLine>& lines);
  MonitorReader& reader_of(const std::string& source);
  Taken refuse(const Hl7Message& message, const std::string& source, std::int64_t arrival_ns, UtcTime now);

  AssumedZone assumed_zone_;
  SenderList senders_;
  PlaceList places_;
  Tally strangers_, elsewhere_, unplaced_;
  Tally refusals_{kMostSenders};  // of refusal_of(), by its name and sender
  std::string last_place_;        // in lower case, of the last part that named one
  std::optional<PatientKey> last_patient_;
  Mixture beds_, patients_;
  std::map<std::string, std::vector<PatientKey>> patients_at_;  // by sender and place
  Tally unreadable_{kMostSenders, kUnreadableKept};             // by peer
  std::atomic<std::int64_t> begins_ns_ = 0;
  std::map<std::string, MonitorReader> readers_;
  std::shared_ptr<PatientWatch> watch_;
  MessageMemory seen_;
};

}  // namespace kiroku::recorder
