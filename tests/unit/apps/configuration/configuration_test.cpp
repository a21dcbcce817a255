#include "apps/configuration/configuration.h"

#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::apps {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string refusal(const std::string& toml) {
  try {
    parse_configuration(toml, "k.toml");
  } catch (const UsageError& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Configuration, DefaultFileStatesTheDefaults) {
  const Configuration read = parse_configuration(default_configuration_text(), "k.toml");
  const Configuration defaults;
  EXPECT_EQ(read.profile, defaults.profile);
  EXPECT_EQ(read.bit_rate, defaults.bit_rate);
  EXPECT_EQ(read.chroma_422, defaults.chroma_422);
  EXPECT_EQ(read.segment, defaults.segment);
  EXPECT_EQ(read.stamp_every, defaults.stamp_every);
  EXPECT_EQ(read.source_timeout, defaults.source_timeout);
  ASSERT_EQ(read.authorities.size(), 1U);
  EXPECT_TRUE(read.authorities[0].is_embedded());
}

TEST(Configuration, ReadsWhichAuthoritiesAreShared) {
  const std::string swiss = "[[authority]]\nname = \"swiss\"\nurl = \"https://tsa.example/tsr\"\n";
  const Configuration alone = parse_configuration(swiss, "k.toml");
  EXPECT_FALSE(alone.authorities.at(0).shared);
  const Configuration read =
      parse_configuration(swiss + "shared = true\nshared_patience = \"40s\"\n", "k.toml");
  EXPECT_TRUE(read.authorities.at(0).shared);
  EXPECT_EQ(read.authorities.at(0).shared_patience, std::chrono::seconds(40));
  EXPECT_EQ(parse_configuration(swiss + "shared = true\n", "k.toml").authorities.at(0).shared_patience,
            std::chrono::seconds(90));
  EXPECT_THAT(refusal(swiss + "shared = \"yes\"\n"),
              HasSubstr("k.toml:4:10: 'shared' must be true or false"));
  EXPECT_THAT(refusal(swiss + "shared = true\nshared_patience = \"1h\"\n"), HasSubstr("between 2s and 10m"));
  EXPECT_THAT(refusal("[[authority]]\nname = \"embedded\"\nurl = \"embedded\"\nshared = true\n"),
              HasSubstr("others cannot share it"));
}

constexpr const char* kRuleRoom =
    "[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"endoscope\"\nsource = \"synthetic:pattern\"\n"
    "[[room.stream]]\nname = \"vitals\"\nkind = \"vitals\"\nsource = \"synthetic:patient\"\n";

std::string with_rule(const std::string& keys) {
  return "[recording]\n[[recording.profile_for]]\n" + keys + kRuleRoom;
}

TEST(Configuration, RefusesStreamsWithTheNamesOfOthers) {
  const auto named = [](const std::string& name) {
    return refusal("[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"" + name +
                   "\"\nsource = \"synthetic:pattern\"\n");
  };
  EXPECT_EQ(named("endoscope"), "accepted");
  EXPECT_THAT(named("events"), HasSubstr("k.toml:4:8: 'name' is 'events'"));
  EXPECT_THAT(named("pointing"), HasSubstr("k.toml:4:8: 'name' is 'pointing'"));
  // What lies in a store below a folder of this name is what policies give to anybody.
  EXPECT_THAT(named("published"), HasSubstr("k.toml:4:8: 'name' is 'published'"));
  EXPECT_EQ(named("published-1"), "accepted");
}

TEST(Configuration, ReadsASecondForm) {
  const auto with = [](const std::string& keys) {
    return "[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"endoscope\"\nsource = "
           "\"synthetic:pattern\"\n" +
           keys;
  };
  const Configuration read = parse_configuration(
      with("also = \"lossless\"\n[[room.footswitch]]\ndevice = \"name:P\"\nkey = 5\npress = \"profile\"\n"
           "profile = \"mpeg2\"\nstreams = [\"endoscope-lossless\"]\n"),
      "k.toml");
  EXPECT_EQ(read.rooms.at(0).streams.at(0).also, recorder::Profile::kLossless);
  EXPECT_THAT(refusal(with("also = \"h264\"\n")), HasSubstr("'also'"));
  EXPECT_THAT(refusal(with("also = \"mpeg2\"\n")), HasSubstr("k.toml:6:8: 'also' is 'mpeg2', as which"));
  EXPECT_THAT(refusal(with("also = \"lossless\"\nkind = \"vitals\"\n")), HasSubstr("of kind video"));
  EXPECT_THAT(refusal(with("also = \"lossless\"\n[[room.stream]]\nname = \"endoscope-lossless\"\n"
                           "source = \"synthetic:room\"\n")),
              HasSubstr("there are two streams named 'endoscope-lossless'"));
  EXPECT_THAT(refusal("[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"" + std::string(26, 'a') +
                      "\"\nsource = \"synthetic:pattern\"\nalso = \"lossless\"\n"),
              HasSubstr("at most 32 characters"));
}

TEST(Configuration, ReadsRulesForTheProfile) {
  const Configuration read = parse_configuration(
      with_rule("name = \"mucosa\"\nwords = [\"EMR\", \"粘膜切除\"]\ncodes = [\"K653\"]\nprofile = "
                "\"lossless\"\nstreams = [\"endoscope\"]\nrooms = [\"or-1\"]\n"
                "[[recording.profile_for]]\nname = \"rest\"\nwords = [\"x\"]\nprofile = \"mpeg2\"\n"),
      "k.toml");
  ASSERT_EQ(read.profile_for.size(), 2U);
  EXPECT_EQ(read.profile_for[0].rule.profile, recorder::Profile::kLossless);
  EXPECT_THAT(read.profile_for[0].rule.words, testing::ElementsAre("EMR", "粘膜切除"));
  const auto of_room = profile_rules_for(read, "or-1", {"endoscope"});
  ASSERT_EQ(of_room.size(), 2U);
  EXPECT_EQ(of_room[0].name, "mucosa");
  const auto of_record = profile_rules_for(read, "", {"endoscope"});
  ASSERT_EQ(of_record.size(), 1U) << "the first one is for a room";
  EXPECT_EQ(of_record[0].name, "rest");
  EXPECT_EQ(profile_rules_for(read, "or-1", {"room"}).size(), 1U) << "it is for a stream that is not there";
}

TEST(Configuration, RefusesRulesForTheProfileThatSayNothing) {
  const std::string good = "name = \"a\"\nwords = [\"EMR\"]\nprofile = \"lossless\"\n";
  EXPECT_EQ(refusal(with_rule(good)), "accepted");
  EXPECT_THAT(refusal(with_rule("name = \"a\"\nwords = [\"EMR\"]\nprofile = \"h264\"\n")),
              HasSubstr("k.toml:5:11: 'profile' is 'h264': it must be mpeg2, uncompressed or lossless"));
  EXPECT_THAT(refusal(with_rule("words = [\"EMR\"]\nprofile = \"lossless\"\n")), HasSubstr("needs a 'name'"));
  EXPECT_THAT(refusal(with_rule("name = \"a\"\nwords = [\"EMR\"]\n")), HasSubstr("needs a 'profile'"));
  EXPECT_THAT(refusal(with_rule("name = \"a\"\nprofile = \"lossless\"\n")),
              HasSubstr("needs 'words' or 'codes'"));
  EXPECT_THAT(refusal(with_rule("name = \"a\"\nwords = [\"\"]\nprofile = \"lossless\"\n")),
              HasSubstr("'words' must hold texts that are not empty"));
  EXPECT_THAT(refusal(with_rule(good + "rooms = [\"or-9\"]\n")),
              HasSubstr("'rooms' names 'or-9', and there is no [[room]] of that name"));
  EXPECT_THAT(refusal(with_rule(good + "streams = [\"vitals\"]\n")),
              HasSubstr("'streams' names 'vitals', which is no video stream of these rooms"));
  EXPECT_THAT(refusal(with_rule(good + "procedures = [\"EMR\"]\n")), HasSubstr("unknown key 'procedures'"));
  EXPECT_THAT(refusal(with_rule(good + "[[recording.profile_for]]\n" + good)),
              HasSubstr("there are two [[recording.profile_for]] named 'a'"));
  EXPECT_THAT(refusal("[recording]\nprofile_for = \"EMR\"\n"), HasSubstr("as a table of its own"));
}

TEST(Configuration, ReadsAFootswitchThatChangesTheProfile) {
  const auto pedal = [](const std::string& keys) {
    return std::string(kRuleRoom) + "[[room.footswitch]]\ndevice = \"/dev/input/x\"\nkey = 184\n" + keys;
  };
  const Configuration read = parse_configuration(
      pedal("press = \"profile\"\nprofile = \"lossless\"\nstreams = [\"endoscope\"]\n"), "k.toml");
  const recorder::FootswitchOptions& footswitch = read.rooms.at(0).footswitches.at(0);
  EXPECT_EQ(footswitch.action, recorder::PressAction::kProfile);
  EXPECT_EQ(footswitch.profile, recorder::Profile::kLossless);
  EXPECT_THAT(footswitch.streams, testing::ElementsAre("endoscope"));
  EXPECT_THAT(refusal(pedal("press = \"profile\"\n")), HasSubstr("has a 'profile' where its press is"));
  EXPECT_THAT(refusal(pedal("press = \"mark\"\nprofile = \"lossless\"\n")),
              HasSubstr("has a 'profile' where its press is"));
  EXPECT_THAT(refusal(pedal("press = \"profile\"\nprofile = \"mpeg2\"\nstreams = [\"vitals\"]\n")),
              HasSubstr("a footswitch names the stream 'vitals'"));
}

TEST(Configuration, ReadsAnAuthorityBehindAProxy) {
  const Configuration read = parse_configuration(
      "[[authority]]\nname = \"a\"\nurl = \"https://tsa.example/\"\nproxy = \"http://p:3128\"\ninterface = "
      "\"wwan0\"\n"
      "connect_timeout = \"2s\"\ntotal_timeout = \"1m\"\n",
      "k.toml");
  ASSERT_EQ(read.authorities.size(), 1U);
  ASSERT_EQ(read.authorities[0].paths.size(), 1U);
  const timestamp::AuthorityPath& path = read.authorities[0].paths[0];
  EXPECT_EQ(path.url, "https://tsa.example/");
  EXPECT_EQ(path.proxy, "http://p:3128");
  EXPECT_EQ(path.network_interface, "wwan0");
  EXPECT_EQ(path.connect_timeout, std::chrono::seconds(2));
  EXPECT_EQ(path.total_timeout, std::chrono::minutes(1));
}

TEST(Configuration, ReadsSeveralPathsToAnAuthorityInTheirOrder) {
  const Configuration read = parse_configuration(
      "[[authority]]\nname = \"a\"\nurl = \"https://tsa.example/\"\ntotal_timeout = \"1m\"\nmin_interval = "
      "\"75s\"\n"
      "[[authority.path]]\n[[authority.path]]\nproxy = \"http://p:3128\"\n[[authority.path]]\ninterface = "
      "\"wwan0\"\n",
      "k.toml");
  ASSERT_EQ(read.authorities.size(), 1U);
  EXPECT_EQ(read.authorities[0].min_interval, std::chrono::seconds(75));
  const auto& paths = read.authorities[0].paths;
  ASSERT_EQ(paths.size(), 3U);
  EXPECT_EQ(timestamp::path_name(paths[0]), "directly");
  EXPECT_EQ(timestamp::path_name(paths[1]), "through the proxy http://p:3128");
  EXPECT_EQ(timestamp::path_name(paths[2]), "over wwan0");
  for (const auto& path : paths) {
    EXPECT_EQ(path.url, "https://tsa.example/");
    EXPECT_EQ(path.total_timeout, std::chrono::minutes(1));
  }
}

TEST(Configuration, RefusesPathsThatAreNone) {
  const std::string authority = "[[authority]]\nname = \"a\"\nurl = \"https://tsa.example/\"\n";
  EXPECT_EQ(refusal(authority + "[[authority.path]]\nprxy = \"x\"\n"),
            "k.toml:5:1: unknown key 'prxy' in [[authority.path]]; known are proxy, interface");
  EXPECT_EQ(refusal(authority + "path = \"wwan0\"\n"), "k.toml:4:8: paths are written as [[authority.path]]");
  EXPECT_EQ(refusal(authority + "path = []\n"), "k.toml:4:8: paths are written as [[authority.path]]");
  EXPECT_EQ(refusal(authority + "proxy = \"p:1\"\n[[authority.path]]\n"),
            "k.toml:5:1: write 'proxy' and 'interface' either in [[authority]] or in its paths");
  EXPECT_EQ(refusal("[[authority]]\nname = \"a\"\nurl = \"embedded\"\n[[authority.path]]\n"),
            "k.toml:4:1: the embedded authority is asked without a network: it has no paths");
  EXPECT_EQ(refusal(authority + "min_interval = \"2d\"\n").substr(0, 12), "k.toml:4:16:");
  EXPECT_EQ(refusal(authority + "min_interval = \"25h\"\n"),
            "k.toml:4:16: 'min_interval' is '25h': it must be between 1ms and 24h");
}

TEST(Configuration, ListensOnThisMachineAlone) {
  const Configuration read = parse_configuration("[daemon]\nlisten = \"127.0.0.1:9464\"\n", "k.toml");
  EXPECT_EQ(read.daemon.listen_address, "127.0.0.1");
  EXPECT_EQ(read.daemon.listen_port, 9464);
  for (const char* text : {"0.0.0.0:9464", "127.0.0.1", "127.0.0.1:", "127.0.0.1:http", "127.0.0.1:70000",
                           "127.0.0.1:0", "9464"}) {
    EXPECT_EQ(refusal("[daemon]\nlisten = \"" + std::string(text) + "\"\n").substr(0, 23),
              "k.toml:2:10: 'listen' i")
        << text;
  }
}

/// What the file written by init shows in comments, as it is once they are taken away.
std::string uncommented_example() {
  const std::string_view all = default_configuration_text();
  std::istringstream lines{std::string(all.substr(all.find("# # An operating room")))};
  std::string example;
  for (std::string line; std::getline(lines, line);) {
    example += (line.starts_with("# ") ? line.substr(2) : line == "#" ? "" : line) + "\n";
  }
  return example;
}

// A mistyped name sealed its stream to everybody in recipients.txt.
TEST(Configuration, RecipientsAreOfWhatIsRecorded) {
  const auto with = [](const std::string& name) {
    return refusal("[recipients]\n" + name + " = \"recipients-few.txt\"\n" + kRuleRoom);
  };
  EXPECT_EQ(with("endoscope"), "accepted");
  EXPECT_EQ(with("vitals"), "accepted");
  EXPECT_EQ(with("events"), "accepted") << "marks and the patient";
  EXPECT_EQ(with("pointing"), "accepted");
  EXPECT_EQ(with("endoscop"),
            "k.toml:2:1: [recipients] names the stream 'endoscop', which nothing here records; known "
            "are endoscope, vitals, room, fluoroscopy, training, forces, events, pointing");
  EXPECT_EQ(with("room"), "accepted") << "`kiroku record` takes it in a home with rooms, too";
  EXPECT_THAT(with("rom"), HasSubstr("which nothing here records"));
  const auto without_rooms = [](const std::string& name) {
    return refusal("[recipients]\n" + name + " = \"recipients-few.txt\"\n");
  };
  for (const char* name : {"room", "endoscope", "fluoroscopy", "vitals", "training", "events"})
    EXPECT_EQ(without_rooms(name), "accepted");
  EXPECT_THAT(without_rooms("rom"), HasSubstr("k.toml:2:1: [recipients] names the stream 'rom'"));
}

// 'endoscope' beside a stream 'endoscope-1' left its film to everybody in recipients.txt.
TEST(Configuration, RecipientsOfANameThatIsAlmostRecordedAreRefused) {
  const auto with = [](const std::string& name, const std::string& stream,
                       const std::string& kind = "video") {
    return refusal("[recipients]\n" + name +
                   " = \"few.txt\"\n[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"" + stream +
                   "\"\nkind = \"" + kind +
                   "\"\nsource = \"synthetic:" + (kind == "video" ? "pattern" : "patient") + "\"\n");
  };
  EXPECT_EQ(with("endoscope", "endoscope-1"),
            "k.toml:2:1: [recipients] names the stream 'endoscope', which no [[room]] records, and room "
            "'or-1' records 'endoscope-1', which everybody in recipients.txt could open: write the name of "
            "what is recorded");
  EXPECT_EQ(with("endoscope-1", "endoscope-1"), "accepted");
  EXPECT_THAT(with("endoscope-1", "endoscope"), HasSubstr("which nothing here records"));
  EXPECT_THAT(with("vitals", "vital", "vitals"), HasSubstr("records 'vital'"));
  EXPECT_THAT(with("forces", "forces-1"), HasSubstr("records 'forces-1'"));
  EXPECT_EQ(with("events", "events-1"), "accepted") << "marks and the patient are always there";
  EXPECT_EQ(with("room", "endoscope-1"), "accepted");
}

TEST(Configuration, RecipientsOfWhatNoRoomRecordsAreTold) {
  const auto doubts = [](const std::string& name, const std::string& rooms) {
    return doubts_of(parse_configuration("[recipients]\n" + name + " = \"few.txt\"\n" + rooms, "k.toml"));
  };
  EXPECT_THAT(doubts("room", kRuleRoom),
              testing::ElementsAre(HasSubstr("names the stream 'room', which no [[room]] records")));
  for (const char* const name : {"endoscope", "vitals", "events", "training"})
    EXPECT_THAT(doubts(name, kRuleRoom), testing::IsEmpty()) << name;
  EXPECT_THAT(doubts("room", ""), testing::IsEmpty());
}

std::string room_of(const std::string& name, const std::string& keys, const std::string& source) {
  return "[[room]]\nname = \"" + name + "\"\n" + keys + "[[room.stream]]\nname = \"endoscope\"\nsource = \"" +
         source + "\"\n";
}

std::string two_rooms(const std::string& first, const std::string& second,
                      const std::string& source = "synthetic:pattern") {
  return room_of("or-1", first, source) + room_of("or-2", second, source);
}

// A patient of one room was sealed into the case of the other.
TEST(Configuration, TwoRoomsHaveNoPlaceInCommon) {
  const auto hl7 = [](const std::string& locations, int port = 2576, const std::string& options = "") {
    return "[room.procedure.hl7]\nlisten = \"mllp://0.0.0.0:" + std::to_string(port) + options + "\"\n" +
           (locations.empty() ? "" : "locations = [" + locations + "]\n");
  };
  EXPECT_EQ(refusal(two_rooms(hl7("\"OR1\""), hl7("\"OR2\""))), "accepted");
  EXPECT_EQ(refusal(two_rooms(hl7("\"SURGERY^OR1\""), hl7("\"CARDIO^OR1\""))), "accepted");
  EXPECT_THAT(refusal(two_rooms(hl7("\"OR1\", \"X\""), hl7("\"or1\""))),
              HasSubstr("k.toml:9:1: rooms 'or-1' and 'or-2' have one of their 'locations' in common, 'OR1' "
                        "and 'or1': a patient who is there would be sealed into the cases of both"));
  EXPECT_THAT(refusal(two_rooms(hl7("\"SURGERY^OR1\""), hl7("\"OR1\""))), HasSubstr("in common"));
  EXPECT_THAT(refusal(two_rooms(hl7("\"OR1\""), hl7("\"OR1\"", 2577))), HasSubstr("in common"));
  EXPECT_EQ(refusal(two_rooms(hl7(""), hl7("", 2577))), "accepted") << "each has an address of its own";
  EXPECT_EQ(refusal(two_rooms(hl7("\"OR1^^^NORTH\""), hl7("\"OR1^^^SOUTH\""))), "accepted");
  EXPECT_THAT(refusal(two_rooms(hl7("\"SURGERY^OR1\""), hl7("\"surgery^OR1^^SOUTH\""))),
              HasSubstr("have one of their 'locations' in common"));
  EXPECT_THAT(refusal(two_rooms(hl7(""), hl7(""))), HasSubstr("room 'or-2' has no 'locations'"));
  EXPECT_THAT(refusal(two_rooms(hl7("\"OR1\""), hl7(""))), HasSubstr("room 'or-2' has no 'locations'"));
  EXPECT_THAT(refusal(two_rooms(hl7(""), hl7("\"OR2\""))), HasSubstr("room 'or-1' has no 'locations'"));
}

TEST(Configuration, MonitorsAreNoVideo) {
  EXPECT_THAT(refusal("[[room]]\nname = \"a\"\n[[room.stream]]\nname = \"vitals\"\n"
                      "source = \"mllp://127.0.0.1:2575\"\n"),
              HasSubstr("where monitors deliver: write kind = \"vitals\""));
}

TEST(Configuration, TwoThatWaitAtOneAddressAreRefused) {
  const auto hl7 = [](const std::string& address) {
    return "[room.procedure.hl7]\nlisten = \"mllp://" + address + "\"\nlocations = [\"" + address + "\"]\n";
  };
  const auto vitals = [](const std::string& address) {
    return "[[room.stream]]\nname = \"vitals\"\nkind = \"vitals\"\nsource = \"mllp://" + address + "\"\n";
  };
  EXPECT_THAT(refusal(two_rooms(hl7("0.0.0.0:2576?allow=10.0.0.1"), hl7("0.0.0.0:2576?allow=10.0.0.2"))),
              HasSubstr("write the same 'listen' in both rooms"));
  EXPECT_THAT(refusal(two_rooms(hl7("0.0.0.0:2576"), vitals("127.0.0.1:2576"))),
              HasSubstr("[room.procedure.hl7] of room 'or-1' and the stream 'vitals' of room 'or-2' wait for "
                        "messages at one port, 2576"));
  EXPECT_THAT(refusal(two_rooms(vitals("0.0.0.0:2575"), vitals("0.0.0.0:2575?sender=B"))),
              HasSubstr("give each a port of its own"));
  EXPECT_THAT(refusal(room_of("or-1", hl7("0.0.0.0:2576") + vitals("0.0.0.0:2576"), "synthetic:pattern")),
              HasSubstr("one port"));
  EXPECT_EQ(refusal(two_rooms(vitals("127.0.0.1:2575"), vitals("127.0.0.2:2575"))), "accepted");
}

TEST(Configuration, TwoRoomsAskForStepsOfTheirOwn) {
  const auto worklist = [](const std::string& keys) {
    return "[room.procedure.worklist]\naddress = \"ris:104\"\n" + keys;
  };
  const std::string one = "station_ae = \"ENDO1\"\n", two = "station_ae = \"ENDO2\"\n";
  EXPECT_EQ(refusal(two_rooms(worklist(one), worklist(two))), "accepted");
  EXPECT_EQ(refusal(two_rooms(worklist("modality = \"ES\"\n"), worklist("modality = \"XA\"\n"))), "accepted");
  for (const auto& [first, second] :
       {std::pair{std::string(), std::string()}, {one, ""}, {"", one}, {one, one}}) {
    EXPECT_THAT(refusal(two_rooms(worklist(first), worklist(second))),
                HasSubstr("rooms 'or-1' and 'or-2' ask the worklist ANY-SCP for the same steps"));
  }
  // Some worklists list by who asks.
  const Configuration by_who_asks = parse_configuration(
      two_rooms(worklist("calling_ae = \"OR1\"\n"), worklist("calling_ae = \"OR2\"\n")), "k.toml");
  EXPECT_THAT(doubts_of(by_who_asks), testing::ElementsAre(HasSubstr("lists by 'calling_ae'")));
}

TEST(Configuration, WhatRoomsShareIsRefusedOrTold) {
  EXPECT_THAT(refusal(two_rooms("", "", "/dev/video0?size=640x480")),
              HasSubstr("the device /dev/video0 is the source of or-1/endoscope and of or-2/endoscope"));
  EXPECT_THAT(refusal(room_of("or-1", "[[room.stream]]\nname = \"room\"\nsource = \"/dev/video0\"\n",
                              "v4l2:/dev/video0")),
              HasSubstr("'also' archives pictures in a second form"));
  const auto told = [](const std::string& toml) { return doubts_of(parse_configuration(toml, "k.toml")); };
  EXPECT_THAT(
      told(two_rooms("", "", "rtsp://user:secret@camera/1")),
      testing::ElementsAre(testing::AllOf(HasSubstr("or-1/endoscope and or-2/endoscope have one source"),
                                          testing::Not(HasSubstr("secret")))));
  EXPECT_THAT(told(two_rooms("", "")), testing::IsEmpty()) << "each room has a synthetic one of its own";
  const std::string pedal = "[[room.footswitch]]\ndevice = \"name:P\"\nkey = 183\npress = ";
  EXPECT_THAT(told(two_rooms(pedal + "\"start\"\n", pedal + "\"start\"\n")),
              testing::ElementsAre(HasSubstr("both act on key 183 of the footswitch name:P")));
  EXPECT_THAT(refusal(two_rooms("", pedal + "\"start-stop\"\n" + pedal + "\"start\"\n")),
              HasSubstr("room 'or-2' has two presses for key 183 of the footswitch name:P, \"start-stop\" "
                        "and \"start\""));
  EXPECT_EQ(refusal(two_rooms("", pedal + "\"start\"\n" + pedal + "\"mark\"\n")), "accepted");
}

TEST(Configuration, RetentionOfWhatNothingRecordsIsTold) {
  const auto idle = [](const std::string& rule, const std::string& rooms) {
    return idle_retention(parse_configuration(
        "[[retention]]\nafter = \"1d\"\npolicy = \"p\"\n" + rule + "\n" + rooms, "k.toml"));
  };
  for (const char* good : {"stream = \"endoscope\"", "purpose = \"vitals\"", "stream = \"events\""})
    EXPECT_THAT(idle(good, kRuleRoom), testing::IsEmpty()) << good;
  EXPECT_THAT(
      idle("stream = \"endoscop\"", kRuleRoom),
      testing::ElementsAre(testing::AllOf(HasSubstr("the stream 'endoscop'"), HasSubstr("endoscope"))));
  EXPECT_THAT(idle("purpose = \"quality\"", kRuleRoom),
              testing::ElementsAre(HasSubstr("the purpose 'quality'")));
  EXPECT_THAT(idle("stream = \"room\"", ""), testing::IsEmpty());
  EXPECT_THAT(idle("stream = \"room-lossless\"", ""), testing::IsEmpty());
  EXPECT_THAT(idle("stream = \"rom\"", ""), testing::SizeIs(1));
}

TEST(Configuration, ACaseIsLongerThanWhatWasRecordedAheadOfIt) {
  const auto with = [](const std::string& rules) {
    return refusal("[[room]]\nname = \"or-1\"\n" + rules +
                   "[[room.stream]]\nname = \"endoscope\"\nsource = \"synthetic:pattern\"\n");
  };
  EXPECT_EQ(with("pre_roll = \"44m\"\nlongest_case = \"45m\"\n"), "accepted");
  EXPECT_THAT(with("pre_roll = \"1h\"\nlongest_case = \"45m\"\n"),
              HasSubstr("k.toml:3:12: 'pre_roll' is not shorter than 'longest_case'"));
}

// 24 hours were meant, and 24 seconds would be taken: every case would end as it begins.
TEST(Configuration, ALengthOfTimeWithoutAUnitIsRefused) {
  const std::string stream = "[[room.stream]]\nname = \"endoscope\"\nsource = \"synthetic:pattern\"\n";
  const auto of_room = [&](const std::string& rules) {
    return refusal("[[room]]\nname = \"or-1\"\n" + rules + stream);
  };
  const auto unclear = HasSubstr("which does not say of what: write 24h, 15min or 90s");
  for (const std::string key : {"longest_case", "stop_after_silence", "pre_roll", "signal_lasts"}) {
    EXPECT_THAT(of_room(key + " = \"24\"\n"),
                AllOf(HasSubstr("k.toml:3:"), HasSubstr("'" + key + "' is '24'"), unclear));
    EXPECT_THAT(of_room(key + " = 24\n"), HasSubstr("'" + key + "' must be a text in quotation marks"));
  }
  EXPECT_THAT(of_room("longest_case = \"24:00\"\n"), HasSubstr("may be hours and minutes"));
  EXPECT_EQ(of_room("longest_case = \"24:00:00\"\n"), "accepted");
  EXPECT_THAT(of_room("resume = true\nresume_within = \"20\"\n"), unclear);
  for (const std::string key : {"segment", "stamp_every", "source_timeout"})
    EXPECT_THAT(refusal("[recording]\n" + key + " = \"2\"\n"), unclear) << key;
  EXPECT_THAT(refusal("[storage]\nwarn_below = \"8\"\n"), unclear);
  for (const std::string key : {"connect_timeout", "total_timeout", "min_interval", "shared_patience"})
    EXPECT_THAT(refusal("[[authority]]\nname = \"a\"\nurl = \"https://a.example/\"\n" + key + " = \"5\"\n"),
                unclear)
        << key;
  EXPECT_THAT(of_room("[room.procedure.hl7]\nlisten = \"mllp://127.0.0.1:1\"\nwindow = \"12\"\n"), unclear);
  for (const std::string key : {"refresh", "timeout", "window"})
    EXPECT_THAT(of_room("[room.procedure.worklist]\n" + key + " = \"60\"\n"), unclear) << key;
}

// Six months were meant.
TEST(Configuration, WhatErasesSaysWhetherItIsMinutesOrMonths) {
  const auto text = [](const std::string& after) {
    return "[[retention]]\nstream = \"a\"\nafter = \"" + after + "\"\npolicy = \"p\"\n";
  };
  const auto with = [&](const std::string& after) { return refusal(text(after)); };
  // It only erases: an upgrade that finds it so records on.
  const Configuration unclear = parse_configuration(text("6m"), "k.toml");
  EXPECT_THAT(unclear.retention.rules, testing::IsEmpty());
  EXPECT_THAT(doubtful_retention(unclear),
              testing::ElementsAre(
                  "line 1, [[retention]]: 'after' is '6m', which may be months or minutes: write 6min for "
                  "minutes, and days for months, such as 180d; until then nothing is erased by rules"));
  EXPECT_THROW(require_clear(unclear.retention, "k.toml"), UsageError);
  EXPECT_EQ(with("6min"), "accepted");
  EXPECT_EQ(with("1h30m"), "accepted");
  EXPECT_EQ(with("180d"), "accepted");
  EXPECT_EQ(age_in_words(std::chrono::hours(48)), "2 days");
  EXPECT_EQ(age_in_words(std::chrono::hours(25)), "25 hours");
  EXPECT_EQ(age_in_words(std::chrono::minutes(1)), "1 minute");
  EXPECT_EQ(age_in_words(std::chrono::seconds(61)), "61 seconds");
  EXPECT_EQ(age_in_words(std::chrono::milliseconds(10)), "10 milliseconds");
}

TEST(Configuration, OfSeveralRetentionRulesTheLongerHolds) {
  const std::string stream =
      "[[retention]]\nstream = \"endoscope\"\nafter = \"3650d\"\npolicy = \"ten years\"\n";
  const std::string purpose = "[[retention]]\npurpose = \"record\"\nafter = \"12h\"\npolicy = \"a while\"\n";
  const std::string room =
      "[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"endoscope\"\npurpose = \"record\"\n"
      "source = \"synthetic:pattern\"\nprofile = \"uncompressed\"\nalso = \"mpeg2\"\n";
  const auto unclear = [](const std::string& text) {
    return parse_configuration(text, "k.toml").retention.unclear;
  };
  EXPECT_THAT(unclear(stream + stream),
              testing::ElementsAre("line 5, [[retention]]: it is the second one for the stream 'endoscope': "
                                   "leave the one that holds; until then nothing is erased by rules"));
  EXPECT_THAT(unclear(purpose + purpose),
              testing::ElementsAre(HasSubstr("the second one for the purpose 'record'")));
  EXPECT_THAT(unclear(stream + purpose), testing::IsEmpty());
  for (const std::string& text : {stream + purpose + room, purpose + stream + room}) {
    const Configuration configuration = parse_configuration(text, "k.toml");
    archive::StreamInfo info;
    info.name = "endoscope";
    info.purpose = "record";
    const RetentionRule* holds = rule_for(configuration.retention.rules, info);
    ASSERT_NE(holds, nullptr);
    EXPECT_EQ(holds->policy, "ten years");
    info.name = "endoscope-mpeg2";
    EXPECT_EQ(rule_for(configuration.retention.rules, info)->policy, "a while");
    info.purpose = "other";
    EXPECT_EQ(rule_for(configuration.retention.rules, info), nullptr);
    EXPECT_THAT(
        doubtful_retention(configuration),
        testing::ElementsAre(
            "[[retention]] of the purpose 'record' erases what was recorded 12 hours after the case was "
            "opened, which is less than a day",
            "[[retention]] has two rules for the stream 'endoscope' of room 'or-1': that of the stream "
            "'endoscope', which keeps it longer (3650 days), holds; that of the purpose 'record' (12 "
            "hours) erases nothing of it"));
  }
}

TEST(Configuration, RetentionSaysWhatWhenAndWhy) {
  EXPECT_EQ(refusal("[[retention]]\nafter = \"1d\"\npolicy = \"p\"\n"),
            "k.toml:1:1: a [[retention]] needs either a 'stream' or a 'purpose'");
  EXPECT_EQ(refusal("[[retention]]\nstream = \"a\"\npurpose = \"b\"\nafter = \"1d\"\npolicy = \"p\"\n"),
            "k.toml:1:1: a [[retention]] needs either a 'stream' or a 'purpose'");
  EXPECT_EQ(refusal("[[retention]]\nstream = \"a\"\npolicy = \"p\"\n"),
            "k.toml:1:1: a [[retention]] needs 'after', such as \"30d\"");
  // Thirty days were meant, and thirty seconds would be taken.
  EXPECT_NE(refusal("[[retention]]\nstream = \"a\"\nafter = \"30\"\npolicy = \"p\"\n")
                .find("write 30d, 12h or 90min"),
            std::string::npos);
  EXPECT_EQ(refusal("[[retention]]\nstream = \"a\"\nafter = \"1d\"\n"),
            "k.toml:1:1: a [[retention]] needs a 'policy': why the recording may go");
  EXPECT_EQ(
      refusal("[[retention]]\nstream = \"a\"\nafter = \"1d\"\npolicy = \"p\u2066\"\n"),
      "k.toml:1:1: 'policy' holds \\u{2066}, which is obeyed or cannot be seen where it is shown: write it "
      "without");
  EXPECT_EQ(refusal("[[retention]]\nstream = \"a\"\nafter = \"soon\"\n").substr(0, 37),
            "k.toml:3:9: 'after' is 'soon', which ");
  EXPECT_EQ(refusal("[storage]\nreplicas = [\"copies\"]\n"),
            "k.toml:2:12: 'replicas' has 'copies': write the whole path of an archive's copy");
}

TEST(Configuration, StoreNeedsAPlaceAndATime) {
  EXPECT_FALSE(parse_configuration("", "k.toml").store);
  const std::string whole =
      "[store]\nendpoint = \"https://s.example\"\nbucket = \"recordings\"\nretain = \"3653d\"\n";
  const auto store =
      parse_configuration(whole + "appliance = \"or-1\"\nmegabytes_per_second = 20\n", "k.toml").store;
  ASSERT_TRUE(store);
  EXPECT_EQ(store->endpoint, "https://s.example");
  EXPECT_EQ(store->retain, std::chrono::hours(24) * 3653);
  EXPECT_EQ(store->region, "us-east-1");
  EXPECT_EQ(store->credentials, "store-credentials");
  EXPECT_EQ(store->appliance, "or-1");
  EXPECT_EQ(store->megabytes_per_second, 20);
  EXPECT_FALSE(store->publish_log);
  EXPECT_TRUE(parse_configuration(whole + "publish_log = true\n", "k.toml").store->publish_log);
  EXPECT_THAT(refusal("[store]\nendpoint = \"https://s.example\"\n"),
              HasSubstr("needs 'endpoint', 'bucket' and 'retain'"));
  EXPECT_THAT(refusal(whole + "appliance = \"OR 1\"\n"), HasSubstr("'appliance' is 'OR 1'"));
  EXPECT_THAT(refusal(whole + "megabytes_per_second = 0\n"), HasSubstr("from 1 to"));
  EXPECT_THAT(refusal(whole + "unlimited = [\"daily 19:00-06:00\"]\n"), HasSubstr("no limit beside them"));
  EXPECT_THAT(refusal(whole + "megabytes_per_second = 20\nunlimited = [\"at night\"]\n"),
              HasSubstr("'at night' is no window of time"));
  EXPECT_THAT(refusal("[store]\nretain = \"5m\"\n"), HasSubstr("an hour at least"));
  EXPECT_THAT(refusal("[store]\nretain = \"40000d\"\n"), HasSubstr("36525d"));
  EXPECT_THAT(refusal("[store]\nretain = \"30\"\n"), HasSubstr("does not say of what"));
}

TEST(Configuration, AStoresLimitHoldsOutsideItsWindows) {
  const auto store = parse_configuration(
                         "[store]\nendpoint = \"https://s.example\"\nbucket = \"recordings\"\nretain = "
                         "\"3653d\"\nmegabytes_per_second = 20\nunlimited = [\"mon-fri 22:00-06:00\"]\n",
                         "k.toml")
                         .store;
  const auto at = [&](int day, int hour, int minute) {
    std::tm local{};
    local.tm_wday = day;
    local.tm_hour = hour;
    local.tm_min = minute;
    return store->bytes_per_second_at(local);
  };
  EXPECT_EQ(at(1, 21, 59), 20'000'000U);
  EXPECT_EQ(at(1, 22, 0), 0U);
  EXPECT_EQ(at(6, 5, 59), 0U) << "friday's window";
  EXPECT_EQ(at(6, 6, 0), 20'000'000U);
  EXPECT_EQ(at(6, 23, 0), 20'000'000U);
}

TEST(Configuration, RefusesUnknownKeysWithTheirPlace) {
  EXPECT_EQ(refusal("[recording]\nsegment = \"2s\"\n  bitrat = 4\n").substr(0, 37),
            "k.toml:3:3: unknown key 'bitrat' in [");
  EXPECT_EQ(refusal("recordings = 1\n").substr(0, 37), "k.toml:1:1: unknown key 'recordings' ");
  EXPECT_EQ(refusal("[[authority]]\nname = \"a\"\nurl = \"embedded\"\nprxy = \"\"\n").substr(0, 30),
            "k.toml:4:1: unknown key 'prxy'");
}

TEST(Configuration, RefusesWrongTypesAndValuesWithTheirPlace) {
  EXPECT_EQ(refusal("[recording]\nsource_timeout = \"5ms\"\n"),
            "k.toml:2:18: 'source_timeout' is '5ms': it must be between 100ms and 1m");
  EXPECT_EQ(refusal("[recording]\nprofile = 3\n"),
            "k.toml:2:11: 'profile' must be a text in quotation marks");
  EXPECT_EQ(refusal("[recording]\naudio = \"yes\"\n"), "k.toml:2:9: 'audio' must be true or false");
  EXPECT_EQ(refusal("[recording]\nprofile = \"h264\"\n"),
            "k.toml:2:11: 'profile' is 'h264': it must be mpeg2, uncompressed or lossless");
  EXPECT_EQ(refusal("[recording]\nsegment = \"20s\"\n"),
            "k.toml:2:11: 'segment' is '20s': a segment lasts between 500ms and 9s");
  EXPECT_EQ(refusal("[[authority]]\nname = \"A b\"\nurl = \"embedded\"\n"),
            "k.toml:2:8: 'name' is 'A b': it must be 1 to 32 of a-z, 0-9 and '-', and not begin with '-'");
  EXPECT_EQ(refusal("[[authority]]\nname = \"-a\"\nurl = \"embedded\"\n"),
            "k.toml:2:8: 'name' is '-a': it must be 1 to 32 of a-z, 0-9 and '-', and not begin with '-'");
  EXPECT_EQ(refusal("[[authority]]\nname = \"a\"\nurl = \"ftp://x\"\n"),
            "k.toml:3:7: 'url' is 'ftp://x': it must begin with http:// or https://, or be embedded");
}

TEST(Configuration, RefusesIncompleteAndDoubledAuthorities) {
  EXPECT_EQ(refusal("[[authority]]\nname = \"a\"\n"), "k.toml:1:1: an [[authority]] needs a 'url'");
  EXPECT_EQ(refusal("[authority]\nname = \"a\"\n"), "k.toml:1:1: authorities are written as [[authority]]");
  const std::string one = "[[authority]]\nname = \"a\"\nurl = \"embedded\"\n";
  EXPECT_EQ(refusal(one + one), "k.toml:4:1: there are two authorities named 'a'");
}

TEST(Configuration, RefusesEvidenceThatNamesNoPolicy) {
  EXPECT_EQ(refusal("[evidence]\npolicy = \"\"\n"),
            "k.toml:2:10: 'policy' is empty: name a file, or leave the key out");
  EXPECT_EQ(refusal("[evidence]\npolicies = \"a\"\n"),
            "k.toml:2:1: unknown key 'policies' in [evidence]; known are policy");
  EXPECT_EQ(parse_configuration("", "k.toml").evidence.policy, "");
  EXPECT_EQ(parse_configuration("[evidence]\npolicy = \"a.toml\"\n", "k.toml").evidence.policy, "a.toml");
}

TEST(Configuration, NamesTheSearchKeyOfASiteThatOptsIn) {
  EXPECT_EQ(parse_configuration("", "k.toml").search.key, "");
  EXPECT_EQ(parse_configuration("[search]\nkey = \"search.key\"\n", "k.toml").search.key, "search.key");
  EXPECT_THAT(refusal("[search]\n"), HasSubstr("[search] needs 'key'"));
  EXPECT_THAT(refusal("[search]\nkey = 7\n"), HasSubstr("key"));
  EXPECT_THAT(refusal("[search]\nkeys = \"a\"\n"), HasSubstr("unknown key 'keys' in [search]"));
}

TEST(Configuration, TheExampleOfARoomIsGood) {
  const std::string example = uncommented_example();
  const Configuration read = parse_configuration(example, "k.toml");
  ASSERT_EQ(read.rooms.size(), 1U) << example;
  const RoomConfiguration& room = read.rooms[0];
  EXPECT_EQ(room.streams.size(), 3U);
  EXPECT_EQ(room.rules.start_on_signal, "endoscope");
  EXPECT_EQ(room.rules.resume_within, std::chrono::minutes(10));
  EXPECT_EQ(read.daemon.listen_port, 9464);
  ASSERT_EQ(read.retention.rules.size(), 1U);
  EXPECT_EQ(read.retention.rules[0].after, std::chrono::hours(30 * 24));
  EXPECT_EQ(read.retention.replicas.size(), 1U);
  ASSERT_EQ(room.footswitches.size(), 2U);
  EXPECT_EQ(room.footswitches[0].key, 183);
  EXPECT_EQ(room.footswitches[0].action, recorder::PressAction::kStartStop);
  EXPECT_EQ(room.footswitches[0].mark, "footswitch");
  EXPECT_EQ(room.footswitches[1].action, recorder::PressAction::kProfile);
  ASSERT_TRUE(room.procedure.hl7);
  EXPECT_EQ(room.procedure.hl7->listen, "mllp://0.0.0.0:2576?allow=192.168.7.20");
  EXPECT_EQ(room.procedure.hl7->rule.locations, (std::vector<std::string>{"OR1", "SURGERY^OR1"}));
  ASSERT_TRUE(room.procedure.worklist);
  EXPECT_EQ(room.procedure.worklist->host, "ris.hospital.example");
  EXPECT_EQ(room.procedure.worklist->port, 104);
  EXPECT_EQ(room.procedure.worklist->called_ae, "RIS");
  EXPECT_EQ(room.procedure.worklist->station_ae, "ENDO1");
  EXPECT_EQ(room.procedure.worklist->modality, "ES");
  EXPECT_EQ(room.procedure.worklist->timeout, std::chrono::seconds(5));
  EXPECT_EQ(room.procedure.worklist->refresh, std::chrono::minutes(1));
  EXPECT_EQ(room.procedure.worklist->window, std::chrono::hours(12));
}

TEST(Configuration, RefusesWaysToProcedureDataThatAreNone) {
  const std::string room = "[[room]]\nname = \"a\"\n";
  const std::string hl7 = room + "[room.procedure.hl7]\n", worklist = room + "[room.procedure.worklist]\n";
  EXPECT_EQ(refusal(hl7), "k.toml:3:1: [room.procedure.hl7] needs a 'listen'");
  EXPECT_EQ(refusal(hl7 + "listen = \"rtsp://a\"\n"),
            "k.toml:4:10: 'rtsp://a' is nowhere to wait for HL7 messages: write mllp://ADDRESS:PORT");
  EXPECT_EQ(refusal(hl7 + "window = \"5d\"\n").substr(0, 12), "k.toml:4:10:");
  EXPECT_EQ(refusal(hl7 + "window = \"80h\"\n"),
            "k.toml:4:10: 'window' is '80h': it must be between 1m and 72h");
  EXPECT_EQ(refusal(worklist + "station_ae = \"A\"\n"),
            "k.toml:3:1: [room.procedure.worklist] needs an 'address'");
  for (const char* address : {"ris", "ris:", ":104", "ris:0", "ris:70000", "ris:10x"}) {
    EXPECT_EQ(refusal(worklist + "address = \"" + address + "\"\n"),
              std::string("k.toml:4:11: 'address' is '") + address +
                  "': write a host and a port, such as ris.hospital.example:104");
  }
  EXPECT_EQ(refusal(worklist + "called_ae = \"SEVENTEEN-LETTERS\"\n"),
            "k.toml:4:13: 'called_ae' is 'SEVENTEEN-LETTERS': a title has 1 to 16 printable characters, no "
            "backslash");
  EXPECT_EQ(refusal(room + "[room.procedure]\nworklst = 1\n"),
            "k.toml:4:1: unknown key 'worklst' in [room.procedure]; known are hl7, worklist");
}

TEST(Configuration, CarriesACaseOnOnlyWhereTheRoomSaysSo) {
  const std::string room = "[[room]]\nname = \"a\"\n";
  const std::string stream = "[[room.stream]]\nname = \"endoscope\"\nsource = \"synthetic:endoscope\"\n";
  const auto within = [&](const std::string& keys) {
    return parse_configuration(room + keys + stream, "k.toml").rooms.at(0).rules.resume_within;
  };
  EXPECT_EQ(within(""), std::nullopt);
  EXPECT_EQ(within("resume = false\n"), std::nullopt);
  EXPECT_EQ(within("resume = true\n"), std::chrono::minutes(10));
  EXPECT_EQ(within("resume = true\nresume_within = \"45s\"\n"), std::chrono::seconds(45));
  EXPECT_EQ(within("resume_within = \"12h\"\nresume = true\n"), std::chrono::hours(12));
}

TEST(Configuration, RefusesRulesOfCarryingOnThatSayNothing) {
  const std::string room = "[[room]]\nname = \"a\"\n";
  EXPECT_EQ(refusal(room + "resume = \"yes\"\n").substr(0, 11), "k.toml:3:10");
  for (const char* within : {"9s", "13h"}) {
    EXPECT_EQ(
        refusal(room + "resume = true\nresume_within = \"" + within + "\"\n"),
        std::string("k.toml:4:17: 'resume_within' is '") + within + "': it must be between 10s and 12h");
  }
  for (const char* without : {"", "resume = false\n"}) {
    EXPECT_THAT(refusal(room + "resume_within = \"5m\"\n" + without),
                testing::HasSubstr("k.toml:3:17: 'resume_within' has no effect without 'resume = true'"));
  }
}

TEST(Configuration, AMicrophoneStandsBesidePictures) {
  const std::string room = "[[room]]\nname = \"a\"\n[[room.stream]]\nname = \"room\"\n";
  const std::string camera = "source = \"synthetic:room\"\n";
  EXPECT_EQ(parse_configuration(room + camera + "microphone = \"alsa:hw:1,0\"\n", "k.toml")
                .rooms.at(0)
                .streams.at(0)
                .microphone,
            "alsa:hw:1,0");
  EXPECT_EQ(refusal(room + camera + "microphone = \"hw:1,0\"\n"),
            "k.toml:6:14: 'microphone' is 'hw:1,0': write alsa:hw:1,0 as 'kiroku devices' lists it");
  EXPECT_EQ(
      refusal(room + "source = \"alsa:hw:1,0\"\n"),
      "k.toml:5:10: 'source' is 'alsa:hw:1,0', which has no pictures: write it as 'microphone' of a stream "
      "that has");
  EXPECT_EQ(
      refusal(room + "kind = \"vitals\"\nsource = \"synthetic:patient\"\nmicrophone = \"alsa:hw:1,0\"\n"),
      "k.toml:7:14: 'microphone' is for streams of kind video");
}

TEST(Configuration, RefusesFootswitchesThatAreNone) {
  const std::string one = "[[room]]\nname = \"a\"\n[[room.footswitch]]\n";
  const std::string incomplete =
      "k.toml:3:1: a [[room.footswitch]] needs a 'device', a 'key' and what a 'press' does";
  EXPECT_EQ(refusal(one), incomplete);
  EXPECT_EQ(refusal(one + "device = \"name:Pedal\"\nkey = 183\n"), incomplete);
  EXPECT_EQ(refusal(one + "device = \"pedal\"\n"),
            "k.toml:4:10: 'device' is 'pedal': write a path below /dev/input, or name:NAME");
  EXPECT_EQ(refusal(one + "key = \"KEY_F13\"\n"), "k.toml:4:7: 'key' must be a whole number from 1 to 767");
  EXPECT_EQ(refusal(one + "key = 768\n"), "k.toml:4:7: 'key' must be a whole number from 1 to 767");
  EXPECT_EQ(refusal(one + "press = \"kick\"\n"),
            "k.toml:4:9: 'press' is 'kick': it must be start, stop, start-stop, mark or profile");
}

TEST(Configuration, RefusesWhatIsNoToml) { EXPECT_EQ(refusal("[recording\n").substr(0, 9), "k.toml:1:"); }

}  // namespace
}  // namespace kiroku::apps
