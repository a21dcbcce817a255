#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/storage/file_system.h"
#include "archive/upkeep/retention.h"
#include "tests/support/decoded_video.h"
#include "tests/support/eventually.h"
#include "tests/support/flipped_byte.h"
#include "tests/support/recorded_case.h"
#include "tests/support/recording.h"
#include "viewer/api/api.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::Pair;
using testing::SizeIs;

/// The playback routes over one recorded case, called as the dispatcher calls them.
class PlaybackApiTest : public testing::Test {
 protected:
  PlaybackApiTest() {
    recorder::SessionOptions options = bench_.options();
    options.video = {bench_.stream("room", "synthetic:room?size=96x64&rate=25&beep=1&speed=max"),
                     bench_.stream("silent", "synthetic:pattern?size=96x64&rate=25&speed=max")};
    options.video[0].video.audio = true;
    options.vitals = {bench_.stream("vitals", "synthetic:patient?waves=1&speed=max")};
    options.video[0].recipients = options.video[1].recipients = options.vitals[0].recipients =
        options.event_recipients = reader_.recipients;
    options.duration = 5s;
    options.segment_duration = 2s;
    recorder::Session recording(std::move(options));
    const recorder::SessionResult result = recording.run();
    case_ = result.case_id;
    folder_ = result.folder;

    context_.emplace(ViewerHome{.archive = folder_.parent_path(),
                                .catalogue_file = bench_ / "catalogue.sqlite",
                                .log_folder = bench_ / "log",
                                .users_file = bench_ / "users.sqlite",
                                .control_socket = bench_ / "control",
                                .copies_folder = bench_ / "copies",
                                .device_key = &key_,
                                .device = crypto::VerifierKey("test", key_.public_key()),
                                .trust = bench_.options().trust,
                                .identities = {}},
                     SessionLimits{}, [](const std::string&) {});
    add_playback_routes(router_, *context_);
    surgeon_->unlock(std::make_shared<const crypto::AgeIdentities>(reader_.identities));
  }

  /// `address` below the case, with its query. What a handler refuses has its status and sentence.
  Response get(const std::string& address, const std::shared_ptr<Session>& session) {
    const std::size_t question = address.find('?');
    std::vector<std::string> segments{"api", "cases", case_};
    std::istringstream path(address.substr(0, question));
    for (std::string part; std::getline(path, part, '/');) segments.push_back(part);
    const Router::Match match = router_.match("GET", segments);
    if (match.route == nullptr) return Response::error(404, "no such address");
    Request request;
    request.method = "GET";
    request.parameters = match.parameters;
    request.session = session;
    request.peer = "192.0.2.7";
    if (question != std::string::npos) {
      std::istringstream query(address.substr(question + 1));
      for (std::string field; std::getline(query, field, '&');) {
        request.query.emplace_back(field.substr(0, field.find('=')), field.substr(field.find('=') + 1));
      }
    }
    EXPECT_TRUE(may(session->role(), match.route->right));
    try {
      return match.route->handler(request);
    } catch (const Refusal& refusal) {
      return Response::error(refusal.status(), refusal.what());
    }
  }
  Response get(const std::string& address) { return get(address, surgeon_); }

  static Bytes bytes_of_body(const Response& response) {
    const auto* const body = std::get_if<BytesBody>(&response.body);
    return body == nullptr ? Bytes() : *body->bytes;
  }
  static json json_of(const Response& response) { return json::parse(std::get<std::string>(response.body)); }
  /// `what` of the appliance log's access entries.
  std::vector<std::string> accesses() {
    std::vector<std::string> found;
    std::ifstream log(bench_ / "log" / "ledger.jsonl");
    for (std::string line; std::getline(log, line);) {
      const json entry = json::parse(line);
      if (entry["type"] == "access") found.push_back(entry["what"]);
    }
    return found;
  }
  static std::shared_ptr<Session> session(Role role) {
    return std::make_shared<Session>("haru", role, std::nullopt, Clock::system().now() + 1h);
  }

  test::RecorderBench bench_;
  test::Reader reader_ = test::make_reader();
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  std::shared_ptr<Session> surgeon_ = session(Role::kSurgeon);
  std::string case_;
  std::filesystem::path folder_;
  std::optional<ViewerContext> context_;
  Router router_;
};

TEST_F(PlaybackApiTest, APageCanPlayWhatWasRecorded) {
  const Response init = get("streams/room/init.mp4");
  EXPECT_EQ(init.status, 200);
  EXPECT_THAT(init.type, HasSubstr("codecs=\"avc1.64"));
  EXPECT_THAT(init.headers, Contains(Pair("X-Kiroku-Copy", "viewing copy")));
  Bytes film = bytes_of_body(init);
  for (const char* piece : {"0", "1", "2"}) {
    append(film, bytes_of_body(get(std::string("streams/room/pieces/") + piece + ".mp4")));
  }
  const test::DecodedVideo video = test::decode_video(film);
  EXPECT_THAT(video.complaints, IsEmpty());
  EXPECT_THAT(video.frames, SizeIs(125));
  EXPECT_EQ(get("streams/room/pieces/3.mp4").status, 404);
  EXPECT_EQ(get("streams/room/pieces/9223372036854775807.mp4").status, 404);
  EXPECT_EQ(get("streams/events/pieces/0.mp4").status, 404);
  EXPECT_EQ(get("streams/nowhere/init.mp4").status, 404);
  EXPECT_EQ(test::decode_video(bytes_of_body(get("streams/room/thumbnails/1.jpg"))).frames.at(0).width, 160);
}

TEST_F(PlaybackApiTest, SoundHasAnInitialisationSegmentAndPiecesOfItsOwn) {
  EXPECT_EQ(json_of(get("streams/room/sound")), json::parse(R"({"codecs": "flac"})"));
  const Response init = get("streams/room/sound/init.mp4");
  EXPECT_EQ(init.status, 200);
  EXPECT_EQ(init.type, "audio/mp4; codecs=\"flac\"");
  EXPECT_THAT(init.headers, Contains(Pair("X-Kiroku-Copy", "viewing copy")));
  const Response piece = get("streams/room/sound/pieces/1.mp4");
  EXPECT_EQ(piece.status, 200);
  EXPECT_EQ(piece.type, "audio/mp4");
  EXPECT_EQ(get("streams/room/sound/pieces/9.mp4").status, 404);
  EXPECT_EQ(json_of(get("streams/silent/sound")), json::parse(R"({"codecs": null})"));
  EXPECT_EQ(get("streams/silent/sound/init.mp4").status, 404);
  EXPECT_EQ(get("streams/silent/sound/pieces/1.mp4").status, 404);
  EXPECT_EQ(get("streams/vitals/sound").status, 404);
  EXPECT_EQ(get("streams/room/sound", session(Role::kSurgeon)).status, 423) << "locked";
  EXPECT_THAT(accesses(), testing::UnorderedElementsAre("watched room", "watched silent"));
}

TEST_F(PlaybackApiTest, ArchivedPicturesComeWithTheirTimes) {
  const Response first = get("streams/room/frame.png?at_ns=1000000000&step=0");
  EXPECT_EQ(first.type, "image/png");
  EXPECT_THAT(first.headers, Contains(Pair("X-Kiroku-Frame-Time-Ns", "1000000000")));
  EXPECT_THAT(get("streams/room/frame.png?at_ns=1000000000&step=1").headers,
              Contains(Pair("X-Kiroku-Frame-Time-Ns", "1040000000")));
  EXPECT_THAT(get("streams/room/frame.png?at_ns=1000000000&step=-1").headers,
              Contains(Pair("X-Kiroku-Frame-Time-Ns", "960000000")));
  EXPECT_EQ(get("streams/room/frame.png?at_ns=0&step=-1").status, 404);
  EXPECT_EQ(get("streams/room/frame.png").status, 400);
  EXPECT_EQ(get("streams/room/frame.png?at_ns=0&step=2").status, 400);
  EXPECT_EQ(get("streams/room/frame.png?at_ns=9223372036854775807").status, 400);
}

TEST_F(PlaybackApiTest, VitalSignsAndTheTimeLineAreJson) {
  const json vitals = json_of(get("vitals?from_ns=0&to_ns=5000000000&bins=10"));
  ASSERT_THAT(vitals["series"], Not(IsEmpty()));
  for (const json& series : vitals["series"]) {
    EXPECT_THAT(series["bins"], Not(IsEmpty())) << series["code"];
    EXPECT_THAT(series["bins"][0], SizeIs(5));
    EXPECT_THAT(series["questionable"], IsEmpty()) << series["code"];
    EXPECT_FALSE(series["label"].get<std::string>().empty());
  }
  EXPECT_THAT(vitals["alarms"], IsEmpty());
  const json values = json_of(get("vitals/values?at_ns=3000000000"));
  EXPECT_EQ(values["values"].size(), vitals["series"].size());
  EXPECT_LE(values["values"][0]["time_ns"], 3'000'000'000);
  EXPECT_EQ(get("vitals?from_ns=0").status, 400);
  EXPECT_EQ(get("vitals?from_ns=0&to_ns=1&bins=0").status, 400);

  const json timeline = json_of(get("timeline"));
  EXPECT_THAT(timeline["tokens"], Not(IsEmpty()));
  EXPECT_EQ(timeline["tokens"][0]["kind"], "self-issued");
  EXPECT_EQ(timeline["brackets"][0]["time"], "self-issued");
  EXPECT_TRUE(timeline.contains("marks"));
  EXPECT_EQ(timeline["events_lacking"], 0);
  const json of_auditor = json_of(get("timeline", session(Role::kAuditor)));
  EXPECT_FALSE(of_auditor.contains("marks"));
  EXPECT_FALSE(of_auditor.contains("events_lacking")) << "who cannot open the events does not know";
  EXPECT_EQ(of_auditor["segments"], timeline["segments"]);
}

TEST_F(PlaybackApiTest, WatchingIsEnteredOnceBeforeTheFirstByte) {
  EXPECT_EQ(get("streams/room/pieces/9.mp4").status, 404);
  EXPECT_THAT(accesses(), IsEmpty()) << "nothing left";
  (void)get("streams/room/init.mp4");
  (void)get("streams/room/pieces/0.mp4");
  (void)get("streams/room/frame.png?at_ns=0");
  EXPECT_EQ(accesses(), std::vector<std::string>{"watched room"});
  (void)get("vitals?from_ns=0&to_ns=1000000000");
  EXPECT_EQ(accesses(), (std::vector<std::string>{"watched room", "watched vital signs"}));
}

TEST_F(PlaybackApiTest, WithoutAFittingIdentityNothingIsShown) {
  const auto locked = session(Role::kSurgeon);
  EXPECT_EQ(get("streams/room/init.mp4", locked).status, 423);
  EXPECT_EQ(get("vitals?from_ns=0&to_ns=1", locked).status, 423);
  const auto stranger = session(Role::kSurgeon);
  stranger->unlock(std::make_shared<const crypto::AgeIdentities>(test::make_reader().identities));
  (void)get("streams/room/pieces/0.mp4");  // now in the cache
  EXPECT_EQ(get("streams/room/pieces/0.mp4", stranger).status, 403);
  EXPECT_EQ(get("vitals?from_ns=0&to_ns=1", stranger).status, 403);
  surgeon_->lock();
  EXPECT_EQ(get("streams/room/pieces/0.mp4").status, 423);
}

TEST_F(PlaybackApiTest, ATamperedSegmentIsRefusedInASentence) {
  const test::RecordedCase recorded(folder_, reader_.identities);
  const std::string file = recorded.segments("room").at(1).file.file;
  test::flip_byte(folder_ / file, 500);
  EXPECT_EQ(get("streams/room/pieces/0.mp4").status, 200);
  const Response refused = get("streams/room/pieces/1.mp4");
  EXPECT_EQ(refused.status, 422);
  EXPECT_THAT(std::get<std::string>(refused.body), HasSubstr("is not what the ledger says"));
}

// Whoever watches a case has its pieces, pictures and vital signs remembered for them.
TEST_F(PlaybackApiTest, WhatIsErasedWhileItIsWatchedIsNotShownAnyMore) {
  const std::vector<std::string> of_the_room{
      "streams/room/init.mp4", "streams/room/pieces/0.mp4", "streams/room/sound/pieces/0.mp4",
      "streams/room/thumbnails/0.jpg", "streams/room/frame.png?at_ns=0"};
  for (const std::string& address : of_the_room) EXPECT_EQ(get(address).status, 200) << address;
  EXPECT_THAT(json_of(get("vitals?from_ns=0&to_ns=5000000000"))["series"], Not(IsEmpty()));
  const auto copies = [this] {
    std::size_t count = 0;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(bench_ / "copies"))
      count += entry.path().extension() == ".sealed" ? 1U : 0U;
    return count;
  };
  EXPECT_GT(copies(), 0U);
  const recorder::SessionOptions recorded = bench_.options();
  archive::RetentionOptions erasing;
  erasing.key = recorded.key;
  erasing.device_name = recorded.device_name;
  for (const char* stream : {"room", "vitals"})
    archive::erase_stream(archive::real_file_system(), erasing, folder_, stream, "consent withdrawn");
  for (const std::string& address : of_the_room) EXPECT_EQ(get(address).status, 404) << address;
  EXPECT_TRUE(test::eventually([&] { return copies() == 0; })) << "copies lie on the disk";
  EXPECT_THAT(json_of(get("vitals?from_ns=0&to_ns=5000000000"))["series"], IsEmpty());
  EXPECT_EQ(get("streams/silent/pieces/0.mp4").status, 200) << "what was not erased is still shown";
}

}  // namespace
}  // namespace kiroku::viewer
