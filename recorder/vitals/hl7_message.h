// A message of HL7 version 2 in its vertical-bar form, as monitors send it, faults included. Immutable after
// parsing; thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace kiroku::recorder {

/// MSH-1 and MSH-2. `escape` is '\0' where the message has none.
struct Hl7Separators {
  char field = '|', component = '^', repetition = '~', escape = '\\', subcomponent = '&';
  bool operator==(const Hl7Separators&) const = default;
};

/// What separates the values within a field, and the name it stands for: a view into its message.
class Hl7Field {
 public:
  Hl7Field() = default;
  Hl7Field(std::string_view raw, const Hl7Separators& separators) : raw_(raw), separators_(&separators) {}

  /// As sent (in UTF-8), escapes not resolved.
  [[nodiscard]] std::string_view raw() const { return raw_; }
  /// Nothing, or the explicit nothing "".
  [[nodiscard]] bool empty() const { return raw_.empty() || raw_ == "\"\""; }
  [[nodiscard]] std::vector<Hl7Field> repetitions() const;
  [[nodiscard]] std::vector<Hl7Field> components() const;
  /// From 1, of the first repetition; empty where there are fewer.
  [[nodiscard]] Hl7Field component(std::size_t number) const;
  /// With escapes resolved: \F\ \S\ \T\ \R\ \E\ \P\ \Xhh…\ (bytes, if they are UTF-8), \.br\ (LF),
  /// \H\ \N\ and other formatting (nothing). An escape that is not known stays as it stands.
  [[nodiscard]] std::string text() const;

 private:
  std::string_view raw_;
  const Hl7Separators* separators_ = nullptr;
};

class Hl7Segment {
 public:
  Hl7Segment(std::vector<std::string_view> fields, const Hl7Separators& separators)
      : fields_(std::move(fields)), separators_(&separators) {}

  [[nodiscard]] std::string_view name() const { return fields_.front(); }
  /// Field `number` as HL7 counts: OBX-3 is field(3), MSH-9 is field(9). Empty where there are fewer.
  [[nodiscard]] Hl7Field field(std::size_t number) const;
  [[nodiscard]] std::size_t size() const { return fields_.size(); }
  /// The same with field `number` left out, or with an empty one put before it: for senders that shift
  /// theirs.
  [[nodiscard]] Hl7Segment without(std::size_t number) const;
  [[nodiscard]] Hl7Segment with_empty(std::size_t number) const;

 private:
  std::vector<std::string_view> fields_;
  const Hl7Separators* separators_;
};

class Hl7Message {
 public:
  static constexpr std::size_t kMaximumBytes = 512U << 10;
  static constexpr std::size_t kMaximumSegments = 20'000;

  Hl7Message(const Hl7Message&) = delete;
  Hl7Message& operator=(const Hl7Message&) = delete;
  Hl7Message(Hl7Message&&) = delete;
  Hl7Message& operator=(Hl7Message&&) = delete;
  ~Hl7Message() = default;

  [[nodiscard]] const Hl7Separators& separators() const { return separators_; }
  [[nodiscard]] const std::vector<Hl7Segment>& segments() const { return segments_; }
  [[nodiscard]] const Hl7Segment& header() const { return segments_.front(); }
  /// "ORU^R01": components 1 and 2 of MSH-9.
  [[nodiscard]] std::string type() const;
  [[nodiscard]] std::string control_id() const { return header().field(10).text(); }
  /// Sending application and facility, with their identifiers: "MINDRAY^00A0370098007A80/OR1".
  [[nodiscard]] std::string sender() const;
  /// Sentences on what was taken in stride: a segment end that is missing, another character set than stated.
  [[nodiscard]] const std::vector<std::string>& remarks() const { return remarks_; }
  /// Whether the header of another message stands behind this one's. Its segments would be taken for this
  /// one's: nothing that they say can be believed (hl7_refusal.h).
  [[nodiscard]] bool holds_another() const { return holds_another_; }

 private:
  friend struct Hl7Parse;
  friend struct Hl7Parser;
  Hl7Message() = default;

  std::string text_;  // UTF-8; all views point into it
  Hl7Separators separators_;
  std::vector<Hl7Segment> segments_;
  std::vector<std::string> remarks_;
  bool holds_another_ = false;
};

/// The message, or one sentence saying why it cannot be read.
struct Hl7Parse {
  std::unique_ptr<const Hl7Message> message;
  std::string problem;
};

/// Segments may end with CR, LF or CR LF; where the end of one is missing before PID, PV1, OBR, OBX or NTE it
/// is found; a line that begins with no segment name goes on with the one before (each with a remark).
/// Refused: no MSH at the beginning, separators that cannot be, more than kMaximumBytes or kMaximumSegments.
Hl7Parse parse_hl7_message(std::string_view bytes);

/// The messages in a file or frame: each from one MSH at the beginning of a line to the next; without MLLP's
/// framing bytes, batch and file envelopes (FHS, BHS, BTS, FTS). What stands before the first MSH and is
/// neither is given as it is, for the parser to refuse.
std::vector<std::string_view> split_hl7_messages(std::string_view bytes);

}  // namespace kiroku::recorder
