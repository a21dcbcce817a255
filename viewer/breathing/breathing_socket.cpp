#include "viewer/breathing/breathing_socket.h"

#include <exception>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "viewer/http/request.h"

namespace kiroku::viewer {

using nlohmann::ordered_json;

namespace {

std::string told_text(const std::string& sentence) { return ordered_json{{"told", sentence}}.dump(); }

std::string saved_text(std::uint64_t input, const std::string& file, const SealedModel* seal) {
  ordered_json saved{{"input", input}, {"file", file}, {"seal", nullptr}};
  if (seal) {
    ordered_json stamps = ordered_json::array();
    for (const SealedModel::Stamp& stamp : seal->stamps)
      stamps.push_back({{"authority", stamp.authority},
                        {"time", stamp.time},
                        {"kind", stamp.kind},
                        {"problem", stamp.problem}});
    saved["seal"] = {{"file", seal->file}, {"sha256", seal->sha256}, {"time_stamps", std::move(stamps)}};
  }
  return ordered_json{{"saved", std::move(saved)}}.dump();
}

}  // namespace

BreathingSocket::BreathingSocket(BreathingRoom& room, const std::string& person,
                                 std::shared_ptr<SocketOutput> output)
    : room_(room), person_(person), output_(std::move(output)), place_(room.enter(person)) {
  output_->send_text(opened_json(room_.bench(), room_.sealer() != nullptr).dump());
  output_->send_text(surface_json(room_.bench()).dump());
  live_ = std::make_unique<LiveBreathing>(room_.bench(), listener());
}

void BreathingSocket::receive(const SocketMessage& message) {
  if (!message.is_text) throw Refusal(400, "a message must be text");
  const BreathingMessage said = parse_breathing_message(text_of(message.bytes));
  if (said.input <= last_input_) throw Refusal(400, "'input' must rise from message to message");
  last_input_ = said.input;
  if (const auto* wanted = std::get_if<SaveMotion>(&said.deed)) return save(said.input, *wanted);
  if (const auto* fit = std::get_if<FitDeed>(&said.deed)) return begin_fit(*fit);
  if (std::holds_alternative<CancelFit>(said.deed) && fit_) fit_->cancel();
  if (const auto* motion = std::get_if<MotionDeed>(&said.deed)) live_->apply(said.input, *motion);
  if (const auto* moment = std::get_if<MomentDeed>(&said.deed)) live_->apply(said.input, *moment);
  if (const auto* look = std::get_if<LookDeed>(&said.deed)) live_->apply(said.input, *look);
}

void BreathingSocket::save(std::uint64_t input, const SaveMotion& wanted) {
  if (wanted.seal) return begin_seal(input, wanted);
  const auto task = [this, input, wanted] {
    output_->send_text(saved_text(input, room_.bench().save(wanted.file, wanted.motion), nullptr));
  };
  if (!live_->run_task(task)) throw Refusal(409, "more was asked for than can be computed");
}

void BreathingSocket::begin_seal(std::uint64_t input, const SaveMotion& wanted) {
  if (seal_ && !seal_->over()) return tell("a model is being sealed: wait until its time-stamps have come");
  // Neither a task of the workbench nor of who reads the page's messages: pictures and sliders go on while
  // authorities are asked.
  seal_.reset();
  seal_ = std::make_unique<BackgroundSeal>([this, input, wanted] { return seal(input, wanted); }, output_);
}

std::vector<std::string> BreathingSocket::seal(std::uint64_t input, const SaveMotion& wanted) const {
  std::vector<std::string> messages;
  try {
    if (!room_.sealer()) throw Refusal(404, "this server seals no models: it serves no home of its own");
    const std::string file = room_.bench().save(wanted.file, wanted.motion);
    try {
      const SealedModel sealed =
          room_.sealer()(std::filesystem::absolute(room_.bench().file()).parent_path() / file);
      messages.push_back(saved_text(input, file, &sealed));
    } catch (const std::exception&) {
      messages.push_back(saved_text(input, file, nullptr));
      throw;
    }
  } catch (const std::exception& error) {
    messages.push_back(told_text(error.what()));
  }
  return messages;
}

void BreathingSocket::tell(const std::string& sentence) const { output_->send_text(told_text(sentence)); }

void BreathingSocket::begin_fit(const FitDeed& deed) {
  const auto ended = [output = output_](const std::string& sentence) {
    output->send_text(ordered_json{{"fit_ended", sentence}}.dump());
  };
  if (fit_ && !fit_->over()) return ended("you have a fit computed already: wait for that, or cancel it");
  fit_.reset();
  try {
    BackgroundFit::Listener listener;
    listener.progress = [output = output_](const std::string& doing, std::size_t done, std::size_t all) {
      output->send_text(fitting_json(doing, done, all).dump());
    };
    listener.fitted = [output = output_](const FittedSeries& fitted) {
      output->send_text(fitted_json(fitted).dump());
    };
    listener.ended = ended;
    fit_ =
        std::make_unique<BackgroundFit>(room_.bench(), deed, room_.enter_fit(person_), std::move(listener));
  } catch (const Refusal& refusal) {
    ended(refusal.what());
  }
}

BreathingListener BreathingSocket::listener() {
  BreathingListener out;
  // What a slow browser has not taken yet would only make the next picture later.
  out.ready = [this] { return output_->waiting() == 0; };
  out.shown = [this](const BreathingMoment& moment) {
    output_->send_bytes(std::make_shared<const Bytes>(moment_message(moment)));
  };
  out.moved = [this](const BreathingTable& table) { output_->send_text(path_json(table).dump()); };
  out.measured = [this](const BreathingTable& table) { output_->send_text(similarity_json(table).dump()); };
  out.told = [this](const std::string& sentence) { tell(sentence); };
  out.refused = [this](const std::string& sentence, std::uint64_t input, const BreathingTable& table) {
    output_->send_text(refused_json(sentence, input, table.motion()).dump());
  };
  out.failed = [this](const std::string& sentence) {
    room_.tell("a breathing workbench ended: " + sentence);
    // Nothing is computed any more, however long the connection is kept.
    place_.reset();
    output_->send_text(ordered_json{{"failed", sentence}}.dump());
  };
  return out;
}

}  // namespace kiroku::viewer
