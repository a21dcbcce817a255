// The procedure data of one room: what HL7 messages said, else what the worklist lists. Every function may be
// called from any thread.
#pragma once

#include <memory>

#include "recorder/procedure/procedure_inbox.h"
#include "recorder/procedure/procedure_source.h"
#include "recorder/procedure/worklist.h"

namespace kiroku::recorder {

class RoomProcedure : public ProcedureSource {
 public:
  /// Either may be null. Several rooms may share an inbox.
  RoomProcedure(std::shared_ptr<const ProcedureInbox> inbox, ProcedureRule rule,
                std::unique_ptr<Worklist> worklist)
      : inbox_(std::move(inbox)), rule_(std::move(rule)), worklist_(std::move(worklist)) {}

  /// Where both know the same patient, the worklist completes what the messages say.
  [[nodiscard]] std::optional<ProcedureData> find(UtcTime at) const override {
    std::optional<ProcedureData> found = inbox_ ? inbox_->find(rule_, at) : std::nullopt;
    std::optional<ProcedureData> listed = worklist_ ? worklist_->find(at) : std::nullopt;
    if (!found) return listed;
    const bool completes = listed && !found->patient_id.empty() && may_be_same_patient(*listed, *found);
    if (completes) complete(*found, *listed);
    return found;
  }
  [[nodiscard]] std::vector<ProcedureData> list(UtcTime at) const override {
    std::vector<ProcedureData> all = inbox_ ? inbox_->list(rule_, at) : std::vector<ProcedureData>();
    if (worklist_) add_unknown(all, worklist_->list(at));
    order_by_plan(all, kMostListed);
    return all;
  }
  [[nodiscard]] bool is_doubtful(UtcTime at) const override {
    return (inbox_ && inbox_->is_doubtful(rule_, at)) || (worklist_ && worklist_->is_doubtful(at));
  }
  [[nodiscard]] bool is_too_early(UtcTime at) const override {
    return (inbox_ && inbox_->is_too_early(rule_, at)) || (worklist_ && worklist_->is_too_early(at));
  }
  [[nodiscard]] bool knows_by_messages(UtcTime at) const override {
    return inbox_ && !inbox_->list(rule_, at).empty();
  }
  void hurry() override {
    if (worklist_) worklist_->hurry();
  }
  [[nodiscard]] std::vector<ProcedureWay> ways() const override {
    std::vector<ProcedureWay> ways;
    if (inbox_) ways.push_back(inbox_->way());
    if (worklist_) ways.push_back(worklist_->way());
    return ways;
  }

 private:
  const std::shared_ptr<const ProcedureInbox> inbox_;
  const ProcedureRule rule_;
  const std::unique_ptr<Worklist> worklist_;
};

}  // namespace kiroku::recorder
