// kiroku-decoder: demuxes and decodes what others wrote or sent, in a box (media/box/child.h). Other programs
// start it; it has nothing to say to a person.

#include <cstdio>
#include <string_view>

#include <nlohmann/json.hpp>

#include "media/box/child.h"
#include "media/export/remux_job.h"
#include "media/inspection/frame_count_job.h"
#include "media/libav_filter_library.h"
#include "media/libav_handles.h"
#include "media/light/light_job.h"
#include "media/light/sound_job.h"
#include "recorder/procedure/worklist_box.h"
#include "recorder/source/source_box.h"
#include "viewer/playback/viewing_boxes.h"

namespace {

/// No box lets a file be opened; what is heard or deinterlaced is filtered in it.
void load_filters_before_the_box_closes() {
  try {
    kiroku::media::load_filter_library();
  } catch (const kiroku::Error&) {  // the job that needs it says the same
  }
}

}  // namespace

int main(int argc, char** argv) {
  kiroku::media::silence_libav();
  const std::string_view role = argc == 2 ? argv[1] : "";
  if (role == "probe") kiroku::media::run_box_probe();
  if (role == "source") kiroku::recorder::run_source_box();
  if (role == "segments") {
    load_filters_before_the_box_closes();
    kiroku::media::Jobs jobs = kiroku::playback::viewing_jobs();
    jobs[kiroku::media::kCountFrames] = kiroku::media::count_frames;
    jobs[kiroku::media::kReadLight] = kiroku::media::read_light_in_box;
    jobs[kiroku::media::kReadSound] = kiroku::media::read_sound_in_box;
    kiroku::media::run_job_box(jobs);
  }
  // Of a case of days: as long as it takes, while it says something.
  if (role == "remuxing") kiroku::media::run_job_box(kiroku::media::remux_jobs(), 0);
  if (role == "worklist") kiroku::recorder::run_worklist_box();
  std::fputs(
      "kiroku-decoder: only kiroku and kirokud start this program, to decode in a process without keys\n",
      stderr);
  return 2;
}
