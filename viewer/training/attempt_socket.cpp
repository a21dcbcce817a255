#include "viewer/training/attempt_socket.h"

#include <utility>

#include <nlohmann/json.hpp>

#include "trainer/haptic_rate/plate.h"
#include "trainer/report/score_json.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {
namespace {

using nlohmann::ordered_json;

constexpr double kPicturesPerSecond = 30;

/// Who did what, for the sealed subject of a case.
ordered_json facts_of(const trainer::ExclusionRecord& record, const trainer::ExclusionBody& body,
                      UtcTime began, const std::string& user, std::size_t tests_before) {
  ordered_json facts{{"object", record.object},
                     {"hand", "page"},
                     {"simulated", false},
                     {"fingers", record.fingers},
                     {"vertices", body.object().mesh.nodes.size()},
                     {"tetrahedra", body.object().mesh.tetrahedra.size()},
                     {"stress_shown", record.stress_shown},
                     {"damage_pa", body.task().damage_pa},
                     {"friction", body.task().friction},
                     {"trainee", record.trainee},
                     {"group", record.group},
                     {"session", record.session},
                     {"test", record.test},
                     {"signed_in_as", user},
                     {"began", format_utc(began)}};
  if (record.test) facts["tests_without_result_before"] = tests_before;
  return facts;
}

}  // namespace

AttemptSocket::AttemptSocket(TrainingRoom& room, TrainingUser user, std::shared_ptr<SocketOutput> output)
    : room_(room), user_(std::move(user)), output_(std::move(output)) {}

void AttemptSocket::receive(const SocketMessage& message) {
  if (!message.is_text) throw Refusal(400, "a message must be text");
  const PageMessage said = parse_page_message(text_of(message.bytes));
  if (const auto* asked = std::get_if<BeginMessage>(&said)) {
    begin(*asked);
    return;
  }
  if (!attempt_) throw Refusal(400, "an attempt must begin first");
  if (const auto* input = std::get_if<trainer::PointerInput>(&said)) {
    attempt_->point(*input);
  } else {
    attempt_->give_up();
  }
}

void AttemptSocket::begin(const BeginMessage& message) {
  if (attempt_) throw Refusal(409, "an attempt has begun on this connection already");
  static_cast<void>(trainer::side_by_side_m(message.fingers));  // refuses fingers that no hand has
  room_.require_object(message.object);
  // Who may not train so neither takes the place nor hears who trains.
  room_.with_results([&](const trainer::TrainingDatabase& results) {
    static_cast<void>(require_may_train(results, message.trainee));
  });
  place_ = room_.enter(message.trainee);
  const bool is_kept = room_.options().sealer && user_.may_record;
  if (is_kept) room_.options().sealer->require_room();
  trainer::ExclusionRecord record;
  record.test = message.test;
  record.object = message.object;
  record.fingers = message.fingers;
  record.instrument = message.instrument;
  double practice_left_s = 0;
  std::size_t tests_before = 0;
  const std::int64_t kept = room_.with_results([&](trainer::TrainingDatabase& results) {
    // Again: what was read before the place was taken may have changed.
    const trainer::Trainee trainee = require_may_train(results, message.trainee);
    const std::vector<trainer::ExclusionRecord> records = results.attempts();
    const trainer::TraineeProgress progress = trainer::progress_of(records, trainee.name, record.object);
    const double practice_s = room_.options().practice_s;
    if (const std::string why = trainer::not_allowed(progress, message.test, practice_s); !why.empty())
      throw Refusal(409, trainee.name + " " + why);
    room_.require_pace(user_.name);
    if (!message.test && practice_s > 0) practice_left_s = practice_s - progress.practised_s;
    record.trainee = trainee.name;
    record.group = trainee.group;
    record.stress_shown = !message.test && trainee.group != trainer::kStressHidden;
    record.session = progress.session;
    tests_before = trainer::tests_without_result_before(records, record);
    return results.begin_attempt(trainee, record, utc_now());
  });
  if (is_kept) files_ = room_.options().sealer->keep(kept);
  trainer::ExclusionOptions options;
  options.shows_stress = record.stress_shown;
  // A test is done without help.
  const bool shows_press = message.press && !message.test;
  options.shows_press = shows_press;
  options.picture_rate_hz = kPicturesPerSecond;
  options.most_s = practice_left_s;
  if (!message.instrument.empty()) {
    options.touch = trainer::Touch::kTrocar;
    options.instruments.tip = trainer::instrument_tip_of(message.instrument);
  }
  const auto expert = room_.options().experts.find(message.object);
  if (message.expert && expert != room_.options().experts.end()) options.ghost = expert->second;
  attempt_ = std::make_unique<trainer::LiveAttempt>(
      [this, object = message.object] { return room_.body(object); }, std::move(options), message.fingers,
      listener(kept, record, shows_press, tests_before));
}

trainer::Trainee AttemptSocket::require_may_train(const trainer::TrainingDatabase& results,
                                                  const std::string& name) const {
  trainer::Trainee trainee = results.trainee(name);
  if (trainee.simulated) throw Refusal(409, "this is a simulated trainee, no person");
  if (!may_train_as(user_, trainee)) {
    throw Refusal(403, "only the user bound to " + trainee.name + ", or an administrator, may train so");
  }
  return trainee;
}

trainer::LiveListener AttemptSocket::listener(std::int64_t attempt, const trainer::ExclusionRecord& record,
                                              bool shows_press, std::size_t tests_before) {
  trainer::LiveListener out;
  out.began = [this, attempt, record, shows_press](const trainer::ExclusionBody& body) {
    room_.with_results([&](trainer::TrainingDatabase& results) {
      results.keep_conditions(attempt, trainer::conditions_of(body));
    });
    const trainer::ExclusionTask& task = body.task();
    ordered_json began{{"session", record.session},
                       {"test", record.test},
                       {"stress_shown", record.stress_shown},
                       {"object", record.object},
                       {"fingers", record.fingers},
                       {"vertices", body.object().mesh.nodes.size()},
                       {"damage_pa", task.damage_pa},
                       {"visible_share", task.visible_share},
                       {"hold_s", task.hold_s},
                       {"most_s", task.most_s}};
    if (!record.instrument.empty()) began["instrument"] = record.instrument;
    if (shows_press) began["press_n"] = {trainer::kLeastPressN, trainer::kMostPressN};
    output_->send_text(ordered_json{{"began", began}}.dump());
  };
  out.shown = [this, shows_stress = record.stress_shown](const trainer::LiveView& view) {
    // What a slow browser has not taken yet would only make the next picture later.
    const bool sends = output_->waiting() == 0;
    if (!sends && !files_) return;
    const Bytes jpeg = jpeg_of_moment(view);
    if (files_) files_->see(*view.attempt, jpeg);
    if (sends) output_->send_bytes(std::make_shared<const Bytes>(moment_message(view, shows_stress, jpeg)));
  };
  out.over = [this, attempt, record, tests_before, began = utc_now()](const trainer::LiveOutcome& over) {
    room_.with_results([&](trainer::TrainingDatabase& results) {
      results.end_attempt(attempt, over.ending, over.outcome.score);
    });
    ordered_json told = over_json(over);
    told["attempt"] = attempt;
    told["can_be_sealed"] = files_ != nullptr;
    if (files_) {
      ordered_json facts = facts_of(record, *room_.body(record.object), began, user_.name, tests_before);
      facts["score"] = trainer::score_json(over.outcome.score);
      if (!record.instrument.empty())
        facts["instruments"] = {{"tip", record.instrument}, {"peak_wall_force_n", over.outcome.peak_wall_n}};
      facts["ending"] = trainer::name_of(over.ending);
      facts["attempt"] = attempt;
      const std::string summary = record.trainee + ": " + trainer::name_of(over.ending);
      room_.keep_sealable(record.trainee,
                          {attempt, std::move(files_), over.outcome.motion, facts.dump(), summary});
    }
    // Before the page hears of it: its next attempt comes by another connection.
    place_.reset();
    output_->send_text(ordered_json{{"over", told}}.dump());
  };
  out.failed = [this](const std::string& sentence) {
    room_.options().tell("an attempt ended: " + sentence);
    place_.reset();
    output_->send_text(ordered_json{{"failed", sentence}}.dump());
  };
  return out;
}

}  // namespace kiroku::viewer
