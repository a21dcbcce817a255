#include "recorder/vitals/hl7_message.h"

#include <algorithm>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "recorder/vitals/hl7_charset.h"
#include "tests/support/shared_data.h"

namespace kiroku::recorder {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const std::string kHeader = "MSH|^~\\&|MON^1|OR1|||20260101120000||ORU^R01^ORU_R01|7|P|2.6";

std::unique_ptr<const Hl7Message> parse(std::string_view bytes) {
  Hl7Parse parsed = parse_hl7_message(bytes);
  EXPECT_TRUE(parsed.message) << parsed.problem;
  return std::move(parsed.message);
}

std::vector<std::string> names(const Hl7Message& message) {
  std::vector<std::string> names;
  for (const Hl7Segment& segment : message.segments()) {
    names.emplace_back(segment.name());
  }
  return names;
}

TEST(Hl7Message, CountsFieldsAsTheStandardDoes) {
  const auto message = parse(kHeader + "\rPID|1||x^y&z~w");
  EXPECT_EQ(message->type(), "ORU^R01");
  EXPECT_EQ(message->control_id(), "7");
  EXPECT_EQ(message->sender(), "MON^1/OR1");
  EXPECT_EQ(message->header().field(1).raw(), "|");
  EXPECT_EQ(message->header().field(2).raw(), "^~\\&");
  EXPECT_EQ(message->header().field(12).text(), "2.6");
  EXPECT_EQ(message->header().field(13).raw(), "");
  const Hl7Field field = message->segments().at(1).field(3);
  EXPECT_EQ(field.repetitions().size(), 2U);
  EXPECT_EQ(field.component(1).raw(), "x");
  EXPECT_EQ(field.component(2).raw(), "y&z");
  EXPECT_EQ(field.component(3).raw(), "");
  EXPECT_EQ(field.repetitions().at(1).component(1).raw(), "w");
  EXPECT_THAT(message->remarks(), IsEmpty());
}

TEST(Hl7Message, TakesEveryLineEnd) {
  for (const char* end : {"\r", "\n", "\r\n", "\r\r", "\n\r\n"}) {
    const auto message = parse(kHeader + end + "PID|1" + end + "OBX|1|NM" + end);
    EXPECT_THAT(names(*message), ElementsAre("MSH", "PID", "OBX"));
    EXPECT_THAT(message->remarks(), IsEmpty());
  }
  const auto framed = parse("\x0B" + kHeader + "\rPID|1\r\x1C\r");
  EXPECT_THAT(names(*framed), ElementsAre("MSH", "PID"));
  const std::string ending_with_nul = kHeader + "\rPID|1" + std::string(1, '\0');
  EXPECT_EQ(parse(ending_with_nul)->segments().at(1).field(1).raw(), "1");
}

TEST(Hl7Message, AWordThatEndsAsASegmentBeginsIsOne) {
  const auto message =
      parse("MSH|^~\\&|CLIENTE||||20260101120000||ORU^R01|7|P|2.6\rOBX|1|ST|X||PACIENTE||||||F");
  EXPECT_THAT(names(*message), ElementsAre("MSH", "OBX"));
  EXPECT_EQ(message->header().field(3).raw(), "CLIENTE");
  EXPECT_EQ(message->segments()[1].field(5).raw(), "PACIENTE");
}

TEST(Hl7Message, FindsSegmentsThatAreGluedTogether) {
  const auto message =
      parse(kHeader +
            "\rOBX|1||528399^MDC_DEV^MDC|1|||||||X|||||||AB^EUI-64OBX|2|NM|188736^MDC_MASS^MDC|"
            "1.0.0.1|70|kg|||||R|||OBX|3|NM|1^A^MDC||5");
  EXPECT_THAT(names(*message), ElementsAre("MSH", "OBX", "OBX", "OBX"));
  EXPECT_EQ(message->segments().at(2).field(5).raw(), "70");
  EXPECT_EQ(message->segments().at(3).field(5).raw(), "5");
  EXPECT_THAT(message->remarks(), ElementsAre(HasSubstr("before a OBX is missing"), HasSubstr("OBX")));
}

TEST(Hl7Message, DoesNotCutWordsThatLookLikeSegments) {
  EXPECT_THAT(names(*parse(kHeader + "\rNTE|1||see OBX|L")), ElementsAre("MSH", "NTE"));
  EXPECT_THAT(names(*parse(kHeader + "\rZZZ|OBX|PID|OBR|")), ElementsAre("MSH", "ZZZ"));
}

TEST(Hl7Message, JoinsALineThatIsNoSegmentToTheOneBefore) {
  const auto message = parse(kHeader + "\rOBX|1|TX|R||first line\nsecond line|||F\rOBX|2|TX");
  EXPECT_THAT(names(*message), ElementsAre("MSH", "OBX", "OBX"));
  EXPECT_EQ(message->segments().at(1).field(5).raw(), "first line\nsecond line");
  EXPECT_THAT(message->remarks(), ElementsAre(HasSubstr("no segment name")));
}

TEST(Hl7Message, ReadsSeparatorsAsTheyAreStated) {
  EXPECT_EQ(parse("MSH|^~&|A")->separators(), (Hl7Separators{'|', '^', '~', '\0', '&'}));
  EXPECT_EQ(parse("MSH|^~\\|A")->separators(), (Hl7Separators{'|', '^', '~', '\\', '&'}));
  EXPECT_EQ(parse("MSH|^~\\\\&|A")->separators(), Hl7Separators());
  EXPECT_EQ(parse("MSH|^~\\&#|A")->separators(), Hl7Separators());
  EXPECT_EQ(parse("MSH||A")->separators(), Hl7Separators());
  EXPECT_EQ(parse("MSH@~&#\\@A@B@C@D@@@ORU~R01@9")->type(), "ORU^R01");
}

TEST(Hl7Message, ResolvesEscapes) {
  const auto text = [](std::string_view field) {
    return parse(kHeader + "\rNTE|1||" + std::string(field))->segments().at(1).field(3).text();
  };
  EXPECT_EQ(text("a\\F\\b\\S\\c\\T\\d\\R\\e\\E\\f"), "a|b^c&d~e\\f");
  EXPECT_EQ(text("one\\.br\\two\\.sp\\three"), "one\ntwo\nthree");
  EXPECT_EQ(text("\\H\\bold\\N\\ \\.in+4\\x"), "bold x");
  EXPECT_EQ(text("\\XC3A9\\\\X4142\\"),
            "\xC3\xA9"
            "AB");
  EXPECT_EQ(text("\\XFF\\ \\X4\\ \\Z99\\ \\"), "\\XFF\\ \\X4\\ \\Z99\\ \\");
  EXPECT_EQ(text("50\\100"), "50\\100");
  EXPECT_EQ(text("\"\""), "");
  // Without an escape character a backslash is a backslash.
  EXPECT_EQ(parse("MSH|^~&|A\rNTE|1||a\\F\\b")->segments().at(1).field(3).text(), "a\\F\\b");
}

std::string with_charset(const std::string& charset, const std::string& name) {
  return "MSH|^~\\&|M||||||ORU^R01|1|P|2.6||||||" + charset + "\rPID|1||" + name + "|after";
}

TEST(Hl7Message, ConvertsCharacterSetsBeforeItSplits) {
  struct Example {
    const char *charset, *bytes, *text;
  };
  // Of Shift-JIS the second byte may be | (7C), \ (5C), ^ (5E) or ~ (7E).
  for (const Example& example :
       {Example{"8859/1", "M\xFCller", "Müller"}, Example{"ISO_8859/15", "\xA4", "€"},
        Example{"UNICODE UTF-8", "M\xC3\xBCller", "Müller"}, Example{"UTF-8", "\xE6\x9D\x8E", "李"},
        Example{"SHIFT_JIS", "\x83\x5C\x83\x7C\x83\x5E\x83\x7E", "ソポタミ"}, Example{"CP932", "\xB1", "ｱ"},
        Example{"~ISO IR87", "\x1B$B;3ED\x1B(B", "山田"}, Example{"GB 18030-2000", "\xC0\xEE", "李"},
        Example{"ASCII", "Miller", "Miller"}, Example{"", "Miller", "Miller"}}) {
    const auto message = parse(with_charset(example.charset, example.bytes));
    EXPECT_EQ(message->segments().at(1).field(3).text(), example.text) << example.charset;
    EXPECT_EQ(message->segments().at(1).field(4).text(), "after") << example.charset;
    EXPECT_THAT(message->remarks(), IsEmpty()) << example.charset;
  }
}

TEST(Hl7Message, ReadsBytesThatDoNotFitTheStatedCharacterSetAndSaysSo) {
  struct Example {
    const char *charset, *bytes, *text, *remark;
  };
  for (const Example& example :
       {Example{"", "M\xFCller", "Müller",
                "states no character set (MSH-18) but is not ASCII; it was read as ISO"},
        Example{"ASCII", "M\xC3\xBCller", "Müller", "is not in the character set 'ASCII'"},
        Example{"UNICODE UTF-8", "M\xFCller", "Müller", "it was read as ISO 8859-1"},
        Example{"KLINGON", "M\xC3\xBCller", "Müller",
                "'KLINGON' (MSH-18) is not known; it was read as UTF-8"}}) {
    const auto message = parse(with_charset(example.charset, example.bytes));
    EXPECT_EQ(message->segments().at(1).field(3).text(), example.text);
    EXPECT_THAT(message->remarks(), ElementsAre(HasSubstr(example.remark)));
  }
}

TEST(Hl7Message, SaysWhyItRefuses) {
  EXPECT_EQ(parse_hl7_message("").problem, "the message does not begin with MSH");
  EXPECT_EQ(parse_hl7_message("PID|1").problem, "the message does not begin with MSH");
  EXPECT_EQ(parse_hl7_message("MSH").problem, "MSH-1 is no field separator");
  EXPECT_EQ(parse_hl7_message("MSHA^~\\&A").problem, "MSH-1 is no field separator");
  EXPECT_EQ(parse_hl7_message("MSH|hello|").problem, "MSH-2 names no separators");
  EXPECT_EQ(parse_hl7_message("MSH|^^\\&|").problem, "MSH-1 and MSH-2 name one separator twice");
  EXPECT_EQ(parse_hl7_message(kHeader + "|" + std::string(Hl7Message::kMaximumBytes, 'x')).problem,
            "the message is longer than 512 KiB");
  std::string many = kHeader;
  for (std::size_t i = 0; i < Hl7Message::kMaximumSegments; ++i) {
    many += "\rNTE";
  }
  EXPECT_EQ(parse_hl7_message(many).problem, "the message has more than 20000 segments");
}

TEST(Hl7Message, SplitsFilesAndBatches) {
  const auto split = [](std::string_view bytes) {
    std::vector<std::string> messages;
    for (const std::string_view message : split_hl7_messages(bytes)) {
      messages.emplace_back(message);
    }
    return messages;
  };
  EXPECT_THAT(split("FHS|^~\\&|\rBHS|^~\\&|\rMSH|1\rPID|\rMSH|2\nPID|2\nBTS|1\rFTS|1\r"),
              ElementsAre("MSH|1\rPID|", "MSH|2\nPID|2"));
  EXPECT_THAT(split("\x0BMSH|1\r\x1C\r\x0BMSH|2\r\x1C\r"), ElementsAre("MSH|1", "MSH|2"));
  EXPECT_THAT(split("hello\rMSH|1"), ElementsAre("hello", "MSH|1"));
  EXPECT_THAT(split(""), IsEmpty());
  EXPECT_THAT(split("\r\n\r\n"), IsEmpty());
}

TEST(Hl7Message, ReadsOrRefusesEveryRealMessage) {
  KIROKU_NEEDS_SHARED_DATA("recording/hl7");
  std::size_t files = 0, messages = 0, untyped = 0;
  for (const auto& entry :
       std::filesystem::recursive_directory_iterator(test::shared_data("recording/hl7"))) {
    if (entry.path().extension() != ".hl7") {
      continue;
    }
    ++files;
    const Bytes bytes = test::read_whole(entry.path());
    for (const std::string_view one : split_hl7_messages(text_of(bytes))) {
      const Hl7Parse parsed = parse_hl7_message(one);
      ASSERT_TRUE(parsed.message) << entry.path() << ": " << parsed.problem;
      ++messages;
      untyped += parsed.message->type().empty() ? 1U : 0U;
      if (entry.path().filename() == "unicode-names.hl7") {
        EXPECT_EQ(parsed.message->segments().at(2).field(5).repetitions().at(0).text(), "Müller^Jürgen");
      }
    }
  }
  EXPECT_GE(files, 48U);
  EXPECT_GE(messages, 55U);
  EXPECT_EQ(untyped, 1U);  // "MSH|^~" in the middle of a batch
}

TEST(Hl7Message, SurvivesRandomDamage) {
  std::mt19937 random(20260805);
  const std::string sound =
      kHeader + "||||||SHIFT_JIS\rOBX|1|NM|150456^MDC_PULS_OXIM_SAT_O2^MDC|1.3.1|97|%\\X41\\\r";
  for (int round = 0; round < 5000; ++round) {
    std::string damaged = sound;
    for (unsigned changes = random() % 8; changes > 0; --changes) {
      damaged[random() % damaged.size()] = static_cast<char>(random() % 256);
    }
    const Hl7Parse parsed = parse_hl7_message(damaged);
    EXPECT_EQ(parsed.message == nullptr, !parsed.problem.empty());
    for (const std::string_view one : split_hl7_messages(damaged)) {
      EXPECT_FALSE(one.empty());
    }
  }
}

}  // namespace
}  // namespace kiroku::recorder
