#include "archive/search/search_note.h"

#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace kiroku::search {
namespace {

const std::string kNoted = "20260805T091502Z-3f9c21ab", kCarryingOn = "20260806T091502Z-00000001";
const SearchWords kAbout{"12345", "h", "k653", "jp"};

ApplianceKey after(ApplianceKey key) {
  Step next = key.now.next();
  return {key.appliance, key.series, key.step + 1, std::move(next)};
}

class SearchNoteTest : public testing::Test {
 protected:
  NoteReader::Answer ask(const SearchNote& note, const SearchWords& asked,
                         const std::string& appliance = "or-1", const std::string& case_id = kNoted) {
    return reader_.read(appliance, case_id, note, asked);
  }
  const SiteKey site_ = SiteKey::make();
  const ApplianceKey key_ = site_.key_for("or-1");
  NoteReader reader_{site_.clone()};
};

TEST_F(SearchNoteTest, FitsWhatItsCaseIsAbout) {
  const SearchNote note = make_note(key_, kNoted, kAbout);
  for (const SearchWords& asked : {kAbout, SearchWords{"12345", "", "", ""},
                                   SearchWords{"12345", "h", "", ""}, SearchWords{"", "", "k653", ""},
                                   SearchWords{"", "", "k653", "jp"}, SearchWords{"12345", "", "k653", "jp"}})
    EXPECT_EQ(ask(note, asked), NoteReader::Answer::kFits);
  for (const SearchWords& asked : {SearchWords{"12346", "", "", ""}, SearchWords{"12345", "other", "", ""},
                                   SearchWords{"", "", "k654", ""}, SearchWords{"", "", "k653", "icd"},
                                   SearchWords{"12345", "", "k654", ""}, SearchWords{"k653", "", "", ""},
                                   SearchWords{"", "", "12345", ""}})
    EXPECT_EQ(ask(note, asked), NoteReader::Answer::kDiffers);
}

TEST_F(SearchNoteTest, SaysNothingInTheClearAndNothingTwice) {
  ApplianceKey key = site_.key_for("or-1");
  std::set<std::string> words;
  for (const std::string& id : {kNoted, kCarryingOn}) {
    const SearchNote note = make_note(key, id, kAbout);
    EXPECT_EQ(note.text().find("12345"), std::string::npos);
    EXPECT_EQ(note.text().find("k653"), std::string::npos);
    for (std::size_t at = 0; at < note.hashes.size(); at += 32) words.insert(note.hashes.substr(at, 32));
    key = after(std::move(key));
  }
  EXPECT_EQ(words.size(), 8U) << "one patient's two cases have a word in common";
  // Nobody sees what is not known.
  const SearchNote of_nobody = make_note(key_, kNoted, {});
  EXPECT_EQ(of_nobody.text().size(), make_note(key_, kNoted, kAbout).text().size());
  EXPECT_EQ(ask(of_nobody, {"12345", "", "", ""}), NoteReader::Answer::kDiffers);
  EXPECT_NE(make_note(key_, kNoted, {}).hashes, of_nobody.hashes);
  EXPECT_LE(of_nobody.text().size(), kMostNoteBytes);
}

TEST_F(SearchNoteTest, AnotherKeyFindsNothing) {
  const SearchNote note = make_note(key_, kNoted, kAbout);
  NoteReader stranger(SiteKey::make());
  EXPECT_EQ(stranger.read("or-1", kNoted, note, kAbout), NoteReader::Answer::kForeign);
}

TEST_F(SearchNoteTest, IsOfItsCaseAndItsApplianceAlone) {
  const SearchNote note = make_note(key_, kNoted, kAbout);
  EXPECT_EQ(ask(note, kAbout, "or-2"), NoteReader::Answer::kForeign);
  EXPECT_EQ(ask(note, kAbout, "or-1", kCarryingOn), NoteReader::Answer::kForeign);
  SearchNote other = note;
  other.of.case_id = kCarryingOn;
  EXPECT_EQ(ask(other, kAbout, "or-1", kCarryingOn), NoteReader::Answer::kForeign);
  other = note;
  other.words.case_id = kCarryingOn;
  EXPECT_EQ(ask(other, kAbout), NoteReader::Answer::kForeign);
  // Of another case's words, which somebody put into this note.
  other = note;
  other.hashes = make_note(after(site_.key_for("or-1")), kCarryingOn, kAbout).hashes;
  EXPECT_EQ(ask(other, kAbout), NoteReader::Answer::kForeign);
  other = note;
  other.of.step = kMostSteps - 1;
  EXPECT_EQ(ask(other, kAbout), NoteReader::Answer::kForeign);
  other = note;
  other.of.series = std::string(32, 'a');
  EXPECT_EQ(ask(other, kAbout), NoteReader::Answer::kForeign);
}

TEST_F(SearchNoteTest, ACaseThatCarriesOnIsFoundByTheOthersSubject) {
  const SearchNote first = make_note(key_, kNoted, kAbout);
  const ApplianceKey second_key = after(site_.key_for("or-1")), third_key = site_.key_for("or-1");
  const SearchNote second = carry_over(second_key, kCarryingOn, first);
  EXPECT_EQ(ask(second, kAbout, "or-1", kCarryingOn), NoteReader::Answer::kFits);
  EXPECT_EQ(ask(second, {"12346", "", "", ""}, "or-1", kCarryingOn), NoteReader::Answer::kDiffers);
  const std::string third_case = "20260807T091502Z-00000002";
  const SearchNote third = carry_over(third_key, third_case, second);
  EXPECT_EQ(ask(third, kAbout, "or-1", third_case), NoteReader::Answer::kFits);
}

TEST_F(SearchNoteTest, IsReadOnlyAsItIsWritten) {
  const std::string text = make_note(key_, kNoted, kAbout).text();
  const std::optional<SearchNote> note = SearchNote::parse(text);
  ASSERT_TRUE(note);
  EXPECT_EQ(note->text(), text);
  const auto with = [&](const std::string& what, const std::string& other) {
    std::string changed = text;
    const std::size_t at = changed.find(what);
    EXPECT_NE(at, std::string::npos) << what;
    return changed.replace(at, what.size(), other);
  };
  for (const std::string& bad : {std::string(),
                                 text.substr(0, text.size() - 1),
                                 text + "\n",
                                 " " + text,
                                 text + text,
                                 with("kiroku-search/1", "kiroku-search/2"),
                                 with("\"step\":0", "\"step\":262144"),
                                 with("\"step\":0", "\"step\":-1"),
                                 with("\"step\":0", "\"step\":00"),
                                 with("\"step\":0", "\"step\":0.0"),
                                 with("\"step\":0", "\"step\":9007199254740993"),
                                 with(kNoted, "../../../etc/passwd"),
                                 with(kNoted, "x"),
                                 with("\"words\":\"", "\"words\":\"a"),
                                 with("\"mac\":\"", "\"mac\":\"Z"),
                                 with("\"mac\"", "\"mad\""),
                                 with("{", "{\"more\":1,"),
                                 with("{", "{ "),
                                 with(",\"mac\"", "\n,\"mac\""),
                                 std::string(kMostNoteBytes + 1, ' '),
                                 std::string(1'000, '[')})
    EXPECT_FALSE(SearchNote::parse(bad)) << bad;
  for (std::size_t size = 0; size < text.size(); ++size)
    EXPECT_FALSE(SearchNote::parse(text.substr(0, size)));
}

}  // namespace
}  // namespace kiroku::search
