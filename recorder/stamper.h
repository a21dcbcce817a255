// Has the checkpoints of one case stamped while it is recorded. Each authority is asked on a thread of its
// own: none of them can delay another, or the recording.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "archive/writing/case_writer.h"
#include "recorder/authority_contact.h"
#include "recorder/fact_queue.h"

namespace kiroku::recorder {

class Stamper {
 public:
  struct Context {
    const timestamp::TrustStore* trust = nullptr;  // tokens are judged under it; null: nothing is trusted
    StampingQueue* queue = nullptr;                // remembers what is wanted; null: nobody does
    std::string case_id;                           // for the queue
    /// Told, from any thread, what a person should hear: the queue cannot be used.
    std::function<void(const std::string&)> report{};
    const Clock* clock = &Clock::system();
  };
  /// How long a closing checkpoint waits for an authority that wants to be left alone.
  static constexpr std::chrono::seconds kClosingPatience{10};

  /// Answers go to `facts`. All must outlive the object.
  Stamper(std::vector<NamedAuthority> authorities, Context context, FactQueue& facts);
  /// Waits for requests under way (each has its time limit), for no round, and begins none. What still waits
  /// stays in the queue.
  ~Stamper();
  Stamper(const Stamper&) = delete;
  Stamper& operator=(const Stamper&) = delete;

  /// Wants a token of every authority over the checkpoint, in the place of any older one that still waits,
  /// which it covers. An authority is asked as soon as it may be; one that failed is asked again by itself.
  /// Each request gives one answer; waiting gives none. Where shared tokens are given, a round is waited for
  /// first, whatever the authority demands; it is asked where none comes.
  void stamp(const archive::StoredCheckpoint& checkpoint);
  /// The same for the last checkpoint of the case: authorities that failed are asked once more at once; one
  /// that must be left alone for longer than kClosingPatience is not asked, and the answer says so if it
  /// failed before. (If min_interval alone is in the way there is no answer: nothing has failed, and the
  /// queue knows.)
  void stamp_closing(const archive::StoredCheckpoint& checkpoint);
  /// The token of this answer is in the ledger: it is wanted no more.
  void entered(const AuthorityAnswer& answer);
  /// How many answers to requests under way have not reached the queue of facts yet; after stamp_closing(),
  /// also those that will be asked.
  [[nodiscard]] std::size_t outstanding() const;
  [[nodiscard]] std::vector<AuthorityStatus> status() const;

 private:
  struct Worker;
  Context context_;
  std::vector<std::unique_ptr<Worker>> workers_;
};

}  // namespace kiroku::recorder
