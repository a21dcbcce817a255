// The procedure data of one room: what HL7 messages said, else what the worklist lists. Every function may be
// called from any thread.
#pragma once

#include <algorithm>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "recorder/procedure/procedure_inbox.h"
#include "recorder/procedure/procedure_source.h"
#include "recorder/procedure/window.h"
#include "recorder/procedure/worklist.h"

namespace kiroku::recorder {

class RoomProcedure : public ProcedureSource {
 public:
  /// Either may be null. Several rooms may share an inbox.
  RoomProcedure(const std::shared_ptr<ProcedureInbox>& inbox, ProcedureRule rule,
                std::unique_ptr<Worklist> worklist)
      : inbox_(inbox), rule_(std::move(rule)), worklist_(std::move(worklist)) {
    if (!inbox) return;
    inbox->watch(rule_);
    for (auto& [data, ended] : inbox->recorded(rule_)) ended_.push_back({std::move(data), ended});
  }

  /// Where both know the same patient, the worklist completes what the messages say. Where the messages leave
  /// it in doubt who is there, or plan another patient than the worklist does, nobody is taken. No step is of
  /// somebody who left, as messages say, nor what ended() was told of: a person chooses that again.
  [[nodiscard]] ProcedureChoice choose(UtcTime at) const override {
    ProcedureChoice choice = choose_of_both(at);
    if (choice.data && choice.is_by_plan && was_recorded(*choice.data, at))
      return {{}, Doubt::kRecordedAlready};
    // Nobody may have signed them off yet: whoever is next need not be they.
    if (choice.data && choice.stays_since && is_done(*choice.data, *choice.stays_since, at))
      return {{}, Doubt::kRecordedHere};
    return choice;
  }
  /// By messages alone: lists drop what has begun.
  [[nodiscard]] Objection objection(const ProcedureChoice& taken, UtcTime at) const override {
    return inbox_ ? inbox_->objection(rule_, taken, at) : Objection::kNone;
  }
  [[nodiscard]] std::vector<ProcedureData> list(UtcTime at) const override {
    std::vector<ProcedureData> all = inbox_ ? inbox_->list(rule_, at) : std::vector<ProcedureData>();
    if (worklist_) add_unknown(all, worklist_->list(at));
    order_by_plan(all, kMostListed);
    return all;
  }
  [[nodiscard]] bool knows_by_messages(UtcTime at) const override {
    return inbox_ && !inbox_->list(rule_, at).empty();
  }
  [[nodiscard]] std::optional<Clock::Duration> changed_at() const override {
    return inbox_ ? inbox_->changed_at(rule_) : std::nullopt;
  }
  void cut_off(const ProcedureData& data, UtcTime at) override { note({data, at, true}); }
  void ended(const ProcedureData& data, UtcTime at) override {
    note({data, at});
    // For the process that starts next. Not under the mutex: the inbox asks has_ended() under its own.
    if (inbox_) inbox_->note_recorded(rule_, data, at);
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
  static constexpr std::size_t kMostEnded = 500;
  struct Ended {
    ProcedureData data;
    UtcTime at;
    bool is_cut_off = false;  // by the end of the process: the operation may go on
  };
  void note(Ended one) {
    const std::lock_guard guard(mutex_);
    std::erase_if(ended_,
                  [&](const Ended& each) { return one.at - each.at > ProcedureBook::kLongestWindow; });
    if (ended_.size() >= kMostEnded) ended_.erase(ended_.begin());
    ended_.push_back(std::move(one));
  }

  [[nodiscard]] ProcedureChoice choose_of_both(UtcTime at) const {
    const EndedSince ended = [&](const ProcedureData& data, UtcTime since) {
      return has_ended(data, since, at, true);
    };
    ProcedureChoice told = inbox_ ? inbox_->choose(rule_, at, ended) : ProcedureChoice();
    // What is planned for later says nothing of now.
    const bool is_open =
        told.doubt == Doubt::kNone || told.doubt == Doubt::kTooEarly || told.doubt == Doubt::kRecordAlone;
    if (!worklist_ || !is_open) return told;
    const StandingOf standing = [&](const ProcedureData& data, std::optional<UtcTime> planned) {
      // Of whom messages plan, they say when.
      if (!planned && told.data && may_be_planned_for_both(*told.data, data)) return Standing::kDone;
      const Standing stands = inbox_ ? inbox_->standing(rule_, data, planned, at, ended) : Standing::kOpen;
      if (stands != Standing::kOpen || !planned) return stands;
      // Nobody keeps whoever is in the room waiting.
      const bool is_somebody_there = told.data && !told.is_by_plan;
      return is_somebody_there || ended(data, *planned - kFurthestAhead) ? Standing::kRecorded
                                                                         : Standing::kOpen;
    };
    std::optional<ProcedureData> listed = worklist_->find(at, standing);
    if (!told.data) {
      if (listed) return {std::move(listed), Doubt::kNone, true};
      const Doubt doubt = worklist_->doubt(at, standing);
      return {{}, doubt == Doubt::kNone ? told.doubt : doubt};
    }
    if (!listed) {
      // It may be another patient's whose time is not known, or who is not known to be there still.
      const Doubt doubt = told.is_by_plan ? worklist_->doubt(at, standing) : Doubt::kNone;
      const bool is_in_doubt = doubt == Doubt::kTimeUnclear || doubt == Doubt::kEarlierOpen;
      return is_in_doubt ? ProcedureChoice{{}, doubt} : told;
    }
    if (told.is_by_plan && !may_be_planned_for_both(*told.data, *listed)) return {{}, Doubt::kTwoWays};
    if (!told.data->patient_id.empty() && may_be_same_patient(*listed, *told.data))
      complete(*told.data, *listed);
    return told;
  }
  [[nodiscard]] bool was_recorded(const ProcedureData& data, UtcTime at) const {
    const std::lock_guard guard(mutex_);
    return std::ranges::any_of(ended_, [&](const Ended& each) {
      const auto ago = std::chrono::abs(at - each.at);
      // Of two that state their times these tell them apart, however early one was done.
      const bool is_near =
          is_within(ago, rule_.window) || (!data.planned.empty() && !each.data.planned.empty());
      return ago > kGoesOnWithin && is_near && may_be_same_procedure(data, each.data);
    });
  }
  /// Whether the last case about that patient since then was ended too long ago to go on.
  [[nodiscard]] bool is_done(const ProcedureData& data, UtcTime since, UtcTime at) const {
    return has_ended(data, since, at) && !has_ended(data, std::max(since, at - kGoesOnWithin), at);
  }
  /// A case about that patient, of whatever procedure. `surely`: with it the operation, as far as it is
  /// known.
  [[nodiscard]] bool has_ended(const ProcedureData& data, UtcTime since, UtcTime at,
                               bool surely = false) const {
    const std::lock_guard guard(mutex_);
    return std::ranges::any_of(ended_, [&](const Ended& each) {
      return each.at >= since && each.at <= at && !(surely && each.is_cut_off) &&
             may_be_planned_for_both(data, each.data);
    });
  }
  /// Two systems may write one number in two ways.
  static bool may_be_planned_for_both(const ProcedureData& one, const ProcedureData& other) {
    const auto number = [](const ProcedureData& data) {
      return PatientNumber{data.patient_id, data.patient_id_issuer, {}, {}};
    };
    ProcedureData same = other;
    if (may_be_one(number(one), number(other))) {
      same.patient_id = one.patient_id;
      same.patient_id_issuer = one.patient_id_issuer;
    }
    return may_be_same_patient(one, same);
  }

  const std::shared_ptr<ProcedureInbox> inbox_;
  const ProcedureRule rule_;
  const std::unique_ptr<Worklist> worklist_;
  mutable std::mutex mutex_;
  std::vector<Ended> ended_;  // guarded by it; the oldest first
};

}  // namespace kiroku::recorder
