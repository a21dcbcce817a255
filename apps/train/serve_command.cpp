#include <algorithm>
#include <array>
#include <memory>
#include <thread>

#include <nlohmann/json.hpp>

#include "apps/common/time_option.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/serving.h"
#include "apps/sim/number_option.h"
#include "apps/train/page_sealer.h"
#include "apps/train/train_command.h"
#include "apps/train/training_body.h"
#include "base/error.h"
#include "sim/model/body_model.h"
#include "trainer/exclusion/hand_forces.h"
#include "viewer/training/training_api.h"
#include "viewer/viewer.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;

struct Request {
  ServingRequest serving{.listen = "", .own_port = "8444"};
  std::optional<std::string> database, expert_a, expert_b, at_once;
  std::vector<std::string> organs;
  std::optional<std::string> damage, friction;
  std::string vertices = "4000", seconds = "60", practice = "180";
  bool seal = false;
};

std::map<std::string, trainer::HandMotion> experts_of(const Request& request) {
  std::map<std::string, trainer::HandMotion> experts;
  if (request.expert_a)
    experts["a"] = trainer::parse_hand_motion(sim::read_document(*request.expert_a), *request.expert_a);
  if (request.expert_b)
    experts["b"] = trainer::parse_hand_motion(sim::read_document(*request.expert_b), *request.expert_b);
  return experts;
}

/// Made before anything is served, so that what is wrong with them is told to who starts the server.
void add_organs(const Request& request, const TaskChoice& choice, viewer::TrainingOptions& options) {
  for (const std::string& file : request.organs) {
    std::shared_ptr<const trainer::ExclusionBody> body = make_patient_body(file, choice);
    const auto has_its_name = [&](const auto& other) { return other->object().name == body->object().name; };
    if (std::ranges::any_of(options.organs, has_its_name))
      throw UsageError("two organs are called '" + body->object().name + "': give one another 'name' in " +
                       file);
    options.organs.push_back(std::move(body));
  }
  // Behind what is told at once.
  for (const auto& body : options.organs) {
    trainer::require_haptic_rate(*body, trainer::kMostExclusionFingers,
                                 trainer::measured_force_rate_hz(*body, trainer::kMostExclusionFingers));
    // What a page's trainees may choose; the more fingers, the more likely it is done.
    constexpr std::array<std::size_t, 3> kFingersTried{5, 3, 1};
    if (warn_of_doubt(*body, kFingersTried)) options.doubted.insert(body->object().name);
  }
}

viewer::TrainingOptions training_options(const Request& request, const Home& home) {
  constexpr double kMostSeconds = 3600;
  constexpr std::size_t kMostAtOnce = 64;
  viewer::TrainingOptions options;
  options.database = request.database ? fs::path(*request.database) : home.folder() / "training.sqlite";
  options.vertices =
      parse_count(request.vertices, "--vertices", trainer::kLeastObjectNodes, trainer::kMostObjectNodes);
  options.most_s = parse_seconds(request.seconds, "--seconds", 1, kMostSeconds);
  const TaskChoice choice = task_choice(request.damage, request.friction, options.most_s);
  options.damage_pa = choice.damage_pa.value_or(options.damage_pa);
  options.friction = choice.friction.value_or(options.friction);
  options.at_once = request.at_once ? parse_count(*request.at_once, "--at-once", 1, kMostAtOnce)
                                    : std::max(1U, std::thread::hardware_concurrency() / 2);
  options.practice_s = parse_seconds(request.practice, "--practice", 0, kMostSeconds);
  options.experts = experts_of(request);
  add_organs(request, choice, options);
  if (request.seal) options.sealer = make_page_sealer(home);
  options.tell = tell_on_standard_error();
  return options;
}

int run(const Request& request) {
  const Home home = Home::open(request.serving.home);
  if (!request.serving.listen.empty() && !page_of(request.serving))
    throw UsageError("there is no page to train with: it was not built; name its folder with --web");
  viewer::TrainingRoom room(training_options(request, home));
  const viewer::TrainingOptions& training = room.options();
  serve_until_stopped(request.serving, home,
                      {.serves = "training",
                       .identities = nullptr,
                       .more_routes =
                           [&room](viewer::Router& router, viewer::ViewerContext& /*context*/) {
                             viewer::add_training_routes(router, room);
                           },
                       .tell = room.options().tell,
                       .first_line =
                           [&](const std::string& url) {
                             return "Training" + (url.empty() ? "" : " at " + url) + ", " +
                                    std::to_string(training.at_once) +
                                    (training.at_once == 1 ? " trainee" : " trainees") +
                                    " at a time; results in " + training.database.string();
                           },
                       .tell_more =
                           [&](nlohmann::ordered_json& told) {
                             told["database"] = training.database.string();
                             told["at_once"] = training.at_once;
                           }});
  return kDone;
}

}  // namespace

void add_train_serve_command(Command& train) {
  Command& command = train.add_command("serve", "serves the trainer's page: mouse, keys and touch points");
  const auto request = std::make_shared<Request>();
  command.option("--database", "FILE", request->database, "trainees and results",
                 "training.sqlite in the home");
  command.writes("--database");
  command.option("--vertices", "N", request->vertices, "of the objects' meshes");
  command.option(
      "--organ", "FILE", request->organs,
      "an organ of a CT beside objects A, B and C (docs/explanation/training.md); may stand several times");
  command.option("--damage", "PA", request->damage, "von Mises stress that counts as damage",
                 "100000, or what an organ's file says");
  command.option("--friction", "MU", request->friction,
                 "of a fingertip on the organ: the most force along its surface, in pressing ones; 0 glides",
                 "0.5, or what an organ's file says");
  command.option("--seconds", "T", request->seconds, duration_help("until an attempt is over"));
  command.option("--practice", "T", request->practice,
                 duration_help("of practice in a session before its test; 0 asks for none"));
  command.option("--at-once", "N", request->at_once, "attempts at a time", "half as many as there are cores");
  command.option("--expert-a", "FILE", request->expert_a,
                 "an expert's hand motion on object A, shown on demand");
  command.option("--expert-b", "FILE", request->expert_b, "the same on object B");
  command.flag("--seal", request->seal,
               "surgeons and administrators may make cases of attempts, signed and time-stamped");
  add_serving_options(command, request->serving);
  command.explain(
      "People sign in to the viewer of the home ('kiroku view', or kirokud), choose Training there, and push "
      "the organ aside as the trainee that is "
      "bound to them ('kiroku train trainee --user'), administrators as everybody. What is begun is "
      "kept as broken off until its end is known. 'kiroku train results' reports the same database.");
  command.example("kiroku train serve", "the trainer, behind the home's viewer");
  command.example("kiroku train serve --listen 127.0.0.1:8444", "with an address of its own");
  command.example("kiroku train serve --expert-a lift/hand.txt", "with a hand to follow");
  command.example("kiroku train serve --organ liver.json", "with a patient's liver in the list of organs");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
