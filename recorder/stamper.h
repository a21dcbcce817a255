// Asks the time-stamping authorities, each on a thread of its own: none of them can delay another, or the
// recording.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "archive/case_writer.h"
#include "recorder/fact_queue.h"
#include "timestamp/client.h"
#include "timestamp/token_verifier.h"

namespace kiroku::recorder {

struct NamedAuthority {
  std::string name;  // short: [a-z0-9-], as in file names
  std::shared_ptr<timestamp::StampSource> source;
};

class Stamper {
 public:
  /// Answers go to `facts`, judged under `trust` (null: nothing is trusted). Both must outlive the object.
  Stamper(std::vector<NamedAuthority> authorities, const timestamp::TrustStore* trust, FactQueue& facts);
  /// Waits for requests under way (each has its time limit).
  ~Stamper();
  Stamper(const Stamper&) = delete;
  Stamper& operator=(const Stamper&) = delete;

  /// Asks every authority for a token over the checkpoint. One that still waits for an earlier answer takes
  /// the newest checkpoint next: it covers all earlier ones.
  void stamp(const archive::StoredCheckpoint& checkpoint);
  /// How many answers have not reached the queue yet.
  [[nodiscard]] std::size_t outstanding() const;

 private:
  struct Worker;
  std::vector<std::unique_ptr<Worker>> workers_;
};

}  // namespace kiroku::recorder
