#include <algorithm>
#include <csignal>
#include <iostream>
#include <memory>
#include <mutex>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "apps/common/json_output.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "apps/kiroku/sound_player.h"
#include "apps/kiroku/told_to_end.h"
#include "archive/format/file_reading.h"
#include "base/error.h"
#include "base/listen_address.h"
#include "http/server.h"
#include "light/ledger_follower.h"
#include "light/light_code.h"
#include "light/light_picture.h"
#include "light/sound_code.h"
#include "media/output_file.h"
#include "media/png.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

constexpr std::uint16_t kUsualPort = 8479;

struct Request {
  std::optional<std::string> named, output, listen, home;
  std::string cell = "24";
  bool once = false, json = false, pcm = false;
};

/// What is to be shown now, for whichever thread asks.
class Shown {
 public:
  Shown(std::filesystem::path archive, const std::optional<std::filesystem::path>& one_case)
      : archive_(std::move(archive)) {
    if (one_case) case_ = std::make_unique<light::LedgerFollower>(*one_case);
  }
  struct Now {
    std::int64_t second = 0;
    std::optional<light::ShownLight> light;
    std::string problem;
  };
  Now now() {
    const std::lock_guard guard(mutex_);
    const std::int64_t second =
        std::chrono::floor<std::chrono::seconds>(utc_now()).time_since_epoch().count();
    // One second has one code, whoever asks how often.
    if (second != now_.second) now_ = made(second);
    return now_;
  }
  /// The code that begins to sound now. One is made in the first second of its period alone: later the ledger
  /// may have lines that no code of that second is made of.
  std::optional<std::uint64_t> sound() {
    const Now light = now();
    if (!light.light || light.second % light::kSoundPeriodSeconds != 0) return std::nullopt;
    return light.light->code;
  }

 private:
  Now made(std::int64_t second) {
    if (!case_) {
      auto light = archive_.light_at(second);
      return {second, std::move(light), archive_.problem()};
    }
    try {
      case_->read_on();
      return {second, case_->light_at(second), ""};
    } catch (const Error& error) {
      return {second, std::nullopt, error.what()};
    }
  }

  std::mutex mutex_;  // guards what follows
  light::ArchiveFollower archive_;
  std::unique_ptr<light::LedgerFollower> case_;
  Now now_;
};

constexpr const char* kPage =
    R"(<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Kiroku: light</title><script src="display.js" defer></script></head><body></body></html>
)";

// The whole screen is the code, with its dark margin; nothing where no case is recorded, or none answers.
// A browser plays no sound before somebody asked for it: the button is there while the pointer moves, and
// loudness, in dB of full scale, is kept for the next time where the browser keeps anything. A code that is
// late by more than a second is left out, and so is one while the browser holds sound back: it would play it
// at another time.
constexpr const char* kScript = R"('use strict';
const japanese = navigator.language.startsWith('ja');
const canvas = document.createElement('canvas');
document.body.style.cssText = 'margin:0;background:#000;overflow:hidden;cursor:none';
const panel = document.createElement('form');
panel.style.cssText = 'position:fixed;left:16px;bottom:16px;display:none;gap:12px;align-items:center;padding:8px 12px;' +
  'background:#14181c;color:#c8d0d8;border:1px solid #333c46;border-radius:6px;font:16px sans-serif';
const button = document.createElement('button');
button.type = 'button';
button.style.cssText = 'min-width:96px;min-height:44px;background:#222a32;color:inherit;border:1px solid #4a5764;border-radius:4px;font:inherit';
const label = document.createElement('label');
const loudness = document.createElement('input');
loudness.type = 'range';
loudness.min = '-40';
loudness.max = '0';
function kept_loudness() {
  try {
    return localStorage.getItem('loudness');
  } catch {
    return null;
  }
}
function keep_loudness(value) {
  try {
    localStorage.setItem('loudness', value);
  } catch {
    return;
  }
}
loudness.value = kept_loudness() || '-20';
label.append(japanese ? '音量 ' : 'Loudness ', loudness);
panel.append(button, label);
document.body.append(canvas, panel);
let drawn = null;
let since = Date.now();
let audio = null;
let volume = null;
let sounded = null;
let playing = null;
function tell() {
  const on = audio !== null;
  button.textContent = japanese ? (on ? '音を止める' : '音を出す') : (on ? 'Sound off' : 'Sound');
  button.setAttribute('aria-pressed', String(on));
}
function set_loudness() {
  keep_loudness(loudness.value);
  if (volume) volume.gain.value = 10 ** (Number(loudness.value) / 20);
}
button.addEventListener('click', () => {
  if (audio) {
    audio.close();
    audio = volume = playing = null;
  } else {
    audio = new AudioContext();
    volume = audio.createGain();
    volume.connect(audio.destination);
    set_loudness();
  }
  tell();
});
loudness.addEventListener('input', set_loudness);
tell();
let hiding = 0;
function show_panel() {
  panel.style.display = 'flex';
  document.body.style.cursor = 'default';
  clearTimeout(hiding);
  hiding = setTimeout(() => {
    panel.style.display = 'none';
    document.body.style.cursor = 'none';
  }, 4000);
}
addEventListener('pointermove', show_panel);
addEventListener('pointerdown', show_panel);
addEventListener('keydown', show_panel);
async function sound(second) {
  if (!audio || second === null || second === sounded) return;
  sounded = second;
  const context = audio;
  const begun = Date.now();
  const answer = await fetch('sound.wav', {cache: 'no-store', signal: AbortSignal.timeout(2000)});
  if (answer.status !== 200) return;
  const samples = await context.decodeAudioData(await answer.arrayBuffer());
  if (context !== audio || context.state !== 'running' || Date.now() - begun > 1000) return;
  if (playing) playing.stop();
  playing = context.createBufferSource();
  playing.buffer = samples;
  playing.connect(volume);
  playing.start();
}
function draw(rows) {
  const text = JSON.stringify([rows, innerWidth, innerHeight]);
  if (text === drawn) return;
  drawn = text;
  canvas.width = innerWidth;
  canvas.height = innerHeight;
  const brush = canvas.getContext('2d');
  brush.fillStyle = '#000';
  brush.fillRect(0, 0, canvas.width, canvas.height);
  if (!rows) return;
  const cell = Math.max(1, Math.floor(Math.min(canvas.width / rows[0].length, canvas.height / rows.length)));
  const left = Math.floor((canvas.width - cell * rows[0].length) / 2);
  const top = Math.floor((canvas.height - cell * rows.length) / 2);
  brush.fillStyle = '#fff';
  rows.forEach((row, y) => [...row].forEach((lit, x) => {
    if (lit === '1') brush.fillRect(left + x * cell, top + y * cell, cell, cell);
  }));
}
async function look() {
  try {
    const answer = await fetch('light.json', {cache: 'no-store', signal: AbortSignal.timeout(2000)});
    const now = await answer.json();
    draw(now.rows);
    since = Date.now();
    sound(now.sounds ? now.second : null).catch(() => {});
  } catch {
    if (Date.now() - since > 3000) draw(null);
  }
  setTimeout(look, 100);
}
look();
)";

http::Response respond(int status, const char* type, std::string body) {
  return {status,
          {{"Server", "kiroku"},
           {"Content-Type", type},
           {"Cache-Control", "no-store"},
           {"X-Content-Type-Options", "nosniff"},
           {"Content-Security-Policy",
            "default-src 'none'; script-src 'self'; connect-src 'self'; style-src 'unsafe-inline'; "
            "frame-ancestors 'none'"}},
          std::move(body)};
}

ordered_json json_of(const Shown::Now& now) {
  ordered_json json{
      {"second", now.second}, {"case", nullptr}, {"entries", nullptr}, {"rows", nullptr}, {"sounds", false}};
  if (!now.light) return json;
  json["sounds"] = now.second % light::kSoundPeriodSeconds == 0;
  json["case"] = now.light->case_id;
  json["entries"] = now.light->entries;
  const light::GreyPicture picture = light::light_picture(now.light->code, 1);
  json["rows"] = ordered_json::array();
  for (int y = 0; y < picture.height; ++y) {
    std::string row;
    for (int x = 0; x < picture.width; ++x)
      row += picture.samples[static_cast<std::size_t>(y * picture.width + x)] > 0 ? '1' : '0';
    json["rows"].push_back(row);
  }
  return json;
}

/// RIFF/WAVE with samples of 16 bits, one channel (Microsoft and IBM, "Multimedia Programming Interface and
/// Data Specifications 1.0", 1991).
std::string wav_of(const std::vector<std::int16_t>& samples) {
  std::string wav;
  const auto number = [&wav](std::uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) wav += static_cast<char>(value >> (8 * i) & 0xffU);
  };
  constexpr std::uint32_t kRate = light::SoundCoder::kRate, kHead = 36, kSampleBytes = 2;
  const auto bytes = static_cast<std::uint32_t>(samples.size()) * kSampleBytes;
  wav += "RIFF";
  number(kHead + bytes, 4);
  wav += "WAVEfmt ";
  number(16, 4);  // bytes of what follows
  number(1, 2);   // PCM
  number(1, 2);   // channels
  number(kRate, 4);
  number(kRate * kSampleBytes, 4);
  number(kSampleBytes, 2);
  number(8 * kSampleBytes, 2);
  wav += "data";
  number(bytes, 4);
  for (const std::int16_t sample : samples) number(static_cast<std::uint16_t>(sample), kSampleBytes);
  return wav;
}

http::Response answer(Shown& shown, const light::SoundCoder& coder, const http::Request& request) {
  if (request.method != "GET" && request.method != "HEAD") {
    http::Response refused = respond(405, "text/plain; charset=utf-8", "Only GET is answered here.\n");
    refused.fields.emplace_back("Allow", "GET, HEAD");
    return refused;
  }
  if (request.target == "/") return respond(200, "text/html; charset=utf-8", kPage);
  if (request.target == "/display.js") return respond(200, "text/javascript; charset=utf-8", kScript);
  if (request.target == "/light.json")
    return respond(200, "application/json", json_of(shown.now()).dump() + "\n");
  if (request.target == "/sound.wav") {
    const std::optional<std::uint64_t> code = shown.sound();
    if (!code) return respond(404, "text/plain; charset=utf-8", "No code begins to sound in this second.\n");
    return respond(200, "audio/wav", wav_of(coder.sound_of(*code)));
  }
  return respond(404, "text/plain; charset=utf-8",
                 "There is /, display.js, light.json and sound.wav here.\n");
}

/// "P5 …" of Netpbm, or PNG, by the name.
Bytes file_of(const light::GreyPicture& picture, const std::filesystem::path& name) {
  if (name.extension() == ".png")
    return media::png_of({picture.width, picture.height, 1, picture.samples}, media::PngEffort::kQuick);
  const std::string head =
      "P5\n" + std::to_string(picture.width) + " " + std::to_string(picture.height) + "\n255\n";
  Bytes bytes = to_bytes(bytes_of(head));
  append(bytes, std::as_bytes(std::span(picture.samples)));
  return bytes;
}

void write_picture(const Shown::Now& now, const std::filesystem::path& name, int cell) {
  const auto code = now.light ? std::optional(now.light->code) : std::nullopt;
  media::OutputFile file(name, true);
  file.write(file_of(light::light_picture(code, cell), name));
  file.commit();
}

int cell_of(const std::string& text) {
  constexpr int kMost = 200;
  const bool is_number = !text.empty() && text.size() <= 3 &&
                         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
  const int cell = is_number ? std::stoi(text) : 0;
  if (cell < 1 || cell > kMost)
    throw UsageError("--cell is '" + text + "': give a whole number of pixels from 1 to " +
                     std::to_string(kMost));
  return cell;
}

int run(const Request& request) {
  const int cell = cell_of(request.cell);
  if (request.output) {
    const std::string ending = std::filesystem::path(*request.output).extension().string();
    if (ending != ".png" && ending != ".pgm")
      throw UsageError("cannot write '" + *request.output + "': its name must end in .png or .pgm");
    if (request.listen)
      throw UsageError("--listen serves a page and --output writes a file: give one of them");
  } else if (request.once) {
    throw UsageError("--once writes one picture: say where to with --output FILE");
  }
  if (request.pcm && request.once) throw UsageError("--once writes one picture: it takes no --pcm");
  if (request.pcm && request.json)
    throw UsageError("--pcm and --json both write to standard output: give one of them");
  if (request.pcm && ::isatty(STDOUT_FILENO) != 0)
    throw UsageError(
        "--pcm writes samples of sound: send them to a player, such as | aplay -t raw -f S16_LE -r 48000");
  const std::optional<Home> home = Home::find(request.home);
  std::optional<std::filesystem::path> one_case;
  if (request.named) one_case = find_case(home, *request.named);
  const std::filesystem::path archive =
      one_case ? one_case->parent_path() : Home::open(request.home).archive();
  Shown shown(archive, one_case);
  if (request.once) {
    const Shown::Now now = shown.now();
    if (!now.light)
      throw Error(now.problem.empty()
                      ? "no case is being recorded in " + archive.string() + ", so there is no code"
                      : now.problem);
    write_picture(now, *request.output, cell);
    if (request.json) print_json(json_of(now));
    return kDone;
  }
  end_when_told();
  const light::SoundCoder coder;
  std::unique_ptr<SoundPlayer> player;
  if (request.pcm) {
    ::signal(SIGPIPE, SIG_IGN);
    player = std::make_unique<SoundPlayer>(
        STDOUT_FILENO, coder, [&shown] { return shown.sound(); },
        [] {
          print_error("kiroku",
                      "warning: nobody takes the sound any more: the player ended; codes are shown on");
        });
  }
  std::unique_ptr<http::Server> server;
  if (!request.output) {
    const ListenAddress listen =
        parse_listen_address(request.listen.value_or("127.0.0.1:" + std::to_string(kUsualPort)), kUsualPort);
    http::ServerOptions options;
    options.listen = listen;
    options.answer = [&shown, &coder](const http::Request& asked) { return answer(shown, coder, asked); };
    options.refuse = [](const http::Refusal& refusal) {
      return respond(refusal.status, "text/plain; charset=utf-8", refusal.why + "\n");
    };
    options.most_body_bytes = 0;
    server = std::make_unique<http::Server>(std::move(options));
    const std::string url = "http://" + ListenAddress{listen.host, server->port()}.to_string() + "/";
    if (request.json) {
      print_json({{"url", url}});
    } else {
      (request.pcm ? std::cerr : std::cout)
          << "Shows the codes of the case that is being recorded on " << url << "\n"
          << "Open it full screen on a display that the room's camera sees. Ctrl-C ends it." << std::endl;
    }
    if (!request.pcm) std::cout.flush();
    wait_until_told();
    return kDone;
  }
  std::string told;
  for (;;) {
    const Shown::Now now = shown.now();
    if (!now.problem.empty() && now.problem != told) print_error("kiroku", "warning: " + now.problem);
    told = now.problem;
    write_picture(now, *request.output, cell);
    // A little behind the next second's beginning.
    constexpr std::chrono::milliseconds kBehind{10};
    const UtcTime next(std::chrono::seconds(now.second + 1));
    const auto pause = std::chrono::duration_cast<std::chrono::milliseconds>(next - utc_now()) + kBehind;
    if (wait_until_told(std::clamp(pause, kBehind, std::chrono::milliseconds(1'000) + kBehind))) break;
  }
  // What nobody renews any more is not to stand there.
  write_picture({}, *request.output, cell);
  return kDone;
}

}  // namespace

void add_display_command(Command& program) {
  Command& command =
      program.add_command("display", "shows codes of the ledger in the room, for the room's camera to see");
  const auto request = std::make_shared<Request>();
  command.argument("CASE", request->named,
                   "the case to follow; otherwise whichever of the home's archive is being recorded");
  command.option("--listen", "ADDRESS:PORT", request->listen,
                 "serves the page there; port 0 takes a free one", "127.0.0.1:8479");
  command.option("-o,--output", "FILE", request->output,
                 "writes the picture of each second instead, as .png or .pgm, in one step");
  command.flag("--pcm", request->pcm,
               "also writes the codes as sound to standard output, for a player: raw PCM, 16 bits, little "
               "endian, one channel, 48,000 samples a second");
  command.flag("--once", request->once, "writes one picture, and ends");
  command.option("--cell", "PIXELS", request->cell, "of a cell in such a picture, which has 18 x 11 cells");
  add_home_option(command, request->home);
  command.flag("--json", request->json, "prints one JSON object, then serves");
  command.explain(
      "The code of a second is made of the ledger's newest entry, so nobody can know it before, and the "
      "pictures that show it are later than all that the ledger had then. 'kiroku verify CASE --light' reads "
      "the codes and compares them. A code is public: the page asks for no sign-in and tells nothing of a "
      "patient.");
  command.explain(
      "The room's camera should see the bright frame at least 30 pixels high, not only from the side. Where "
      "no "
      "case is being recorded the screen is dark.");
  command.explain(
      "The same codes are there as faint sound, one in each five seconds, for a room's microphone: by the "
      "button 'Sound' of the page, which shows while the pointer moves, or by --pcm.");
  command.example("kiroku display", "serves the page for a browser on this machine");
  command.example("chromium --kiosk http://127.0.0.1:8479/", "shows it on the whole screen");
  command.example("kiroku display -o /run/kiroku/light.png",
                  "keeps a picture new each second, for a frame buffer");
  command.example("kiroku display --pcm | aplay -q -t raw -f S16_LE -r 48000",
                  "also plays the codes on this machine's loudspeaker");
  command.on_run([request] { return run(*request); });
}

}  // namespace kiroku::apps
