#include "apps/kiroku/camera_look.h"

#include <chrono>
#include <functional>
#include <future>
#include <thread>
#include <utility>

#include "apps/kiroku/group_advice.h"
#include "base/error.h"
#include "media/output_file.h"
#include "media/png.h"
#include "media/rgb_converter.h"
#include "recorder/source/source.h"

namespace kiroku::apps {
namespace {

constexpr std::chrono::seconds kDriverPatience{3}, kPicturePatience{5};
// Cameras open dark: most have adjusted after so many pictures or so long.
constexpr int kPicturesToAdjust = 15;
constexpr std::int64_t kNsToAdjust = 1'000'000'000;

/// Nothing where the driver does not answer in time; the thread is left behind then.
std::optional<recorder::CameraAbility> ability_within(const std::string& node,
                                                      std::chrono::nanoseconds patience) {
  std::packaged_task<recorder::CameraAbility()> task([node] { return recorder::ask_camera(node); });
  std::future<recorder::CameraAbility> answer = task.get_future();
  std::thread(std::move(task)).detach();
  if (answer.wait_for(patience) != std::future_status::ready) return {};
  return answer.get();
}

}  // namespace

CameraLook look_at_camera(const recorder::CameraNode& node) {
  CameraLook look;
  look.node = node;
  if (const auto group = group_advice(node.node)) {
    look.problem = group->finding;
    look.advice = group->advice;
    return look;
  }
  try {
    look.ability = ability_within(node.node, kDriverPatience);
  } catch (const Error& error) {
    look.problem = error.what();
    look.advice = "look at its plug, and at who may open it";
    return look;
  }
  if (!look.ability) {
    look.problem = "its driver does not answer";
    look.advice = "unplug it and plug it in again";
    return look;
  }
  if (look.node.name.empty()) look.node.name = look.ability->card;
  if (!look.ability->captures) return look;
  if (const auto best = recorder::best_mode(look.ability->modes)) {
    look.source = (node.lasting.empty() ? node.node : node.lasting) + recorder::options_of(*best);
  } else {
    look.problem = "it gives pictures in no form that is read here";
    look.advice = "look in its settings for YUYV, MJPEG or H.264";
  }
  return look;
}

Still take_still(const std::string& source, const std::filesystem::path& file, bool overwrite) {
  media::OutputFile output(file, overwrite);
  const recorder::CaseClock clock;
  recorder::OpeningTerms terms;
  terms.patience = kPicturePatience;
  const auto opened = recorder::open_source(recorder::parse_source_address(source), clock, terms);
  Still still{file, opened->input(), opened->remark()};
  const std::int64_t until_ns = clock.now_ns() + kNsToAdjust;
  media::Frame picture;
  for (int i = 0; i < kPicturesToAdjust && (!picture || clock.now_ns() < until_ns); ++i) {
    auto next = opened->read();
    if (!next) break;
    if (!next->is_sound) picture = std::move(next->frame);
  }
  if (!picture) throw Error("source '" + source + "' gave no picture");
  media::RgbConverter converter;
  const auto samples = converter.convert(*picture);
  const recorder::PictureFormat format = recorder::format_of(*picture);
  output.write(media::png_of({format.width, format.height, 3, samples}));
  output.commit();
  return still;
}

}  // namespace kiroku::apps
