#include "evidence/xml_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "evidence/hash_tree.h"
#include "evidence/xml_canonical.h"
#include "tests/support/evidence_kit.h"

namespace kiroku::evidence {
namespace {

using crypto::HashAlgorithm;
using test::codes_of;
using test::day;
using test::hash_of;
using test::object_of;
using test::PlayedAuthority;
using testing::HasSubstr;

std::string refusal_of(const std::string& xml) {
  try {
    XmlRecord::parse(xml);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}
std::string why_not_read(const std::string& xml) {
  try {
    parse_xml(xml);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}
std::string canonical(const std::string& xml, const std::string& method) {
  return canonical_document(parse_xml(xml), canonicalization_named(method).value());
}
constexpr const char* kInclusive = "http://www.w3.org/TR/2001/REC-xml-c14n-20010315";
constexpr const char* kExclusive = "http://www.w3.org/2001/10/xml-exc-c14n#";

// Canonical XML 1.0, section 3.1, without the DOCTYPE.
TEST(CanonicalXml, OfInstructionsAndCommentsIsThePublishedOne) {
  const std::string xml =
      "<?xml version=\"1.0\"?>\n\n<?xml-stylesheet   href=\"doc.xsl\"\n   type=\"text/xsl\"   ?>\n\n"
      "<doc>Hello, world!<!-- Comment 1 --></doc>\n\n<?pi-without-data     ?>\n\n<!-- Comment 2 -->\n\n"
      "<!-- Comment 3 -->";
  EXPECT_EQ(canonical(xml, kInclusive),
            "<?xml-stylesheet href=\"doc.xsl\"\n   type=\"text/xsl\"   ?>\n<doc>Hello, world!</doc>\n"
            "<?pi-without-data?>");
  EXPECT_EQ(canonical(xml, std::string(kInclusive) + "#WithComments"),
            "<?xml-stylesheet href=\"doc.xsl\"\n   type=\"text/xsl\"   ?>\n"
            "<doc>Hello, world!<!-- Comment 1 --></doc>\n<?pi-without-data?>\n<!-- Comment 2 -->\n"
            "<!-- Comment 3 -->");
}

// Section 3.3, without what its DOCTYPE adds.
TEST(CanonicalXml, OfTagsIsThePublishedOne) {
  EXPECT_EQ(
      canonical("<doc>\n   <e1   />\n   <e2   ></e2>\n   <e3   name = \"elem3\"   id=\"elem3\"   />\n"
                "   <e5 a:attr=\"out\" b:attr=\"sorted\" attr2=\"all\" attr=\"I'm\"\n"
                "      xmlns:b=\"http://www.ietf.org\"\n      xmlns:a=\"http://www.w3.org\"\n"
                "      xmlns=\"http://example.org\"/>\n"
                "   <e6 xmlns=\"\" xmlns:a=\"http://www.w3.org\">\n"
                "      <e7 xmlns=\"http://www.ietf.org\">\n"
                "         <e8 xmlns=\"\" xmlns:a=\"http://www.w3.org\">\n"
                "            <e9 xmlns=\"\" xmlns:a=\"http://www.ietf.org\"/>\n"
                "         </e8>\n      </e7>\n   </e6>\n</doc>",
                kInclusive),
      "<doc>\n   <e1></e1>\n   <e2></e2>\n   <e3 id=\"elem3\" name=\"elem3\"></e3>\n"
      "   <e5 xmlns=\"http://example.org\" xmlns:a=\"http://www.w3.org\" xmlns:b=\"http://www.ietf.org\" "
      "attr=\"I'm\" attr2=\"all\" b:attr=\"sorted\" a:attr=\"out\"></e5>\n"
      "   <e6 xmlns:a=\"http://www.w3.org\">\n"
      "      <e7 xmlns=\"http://www.ietf.org\">\n         <e8 xmlns=\"\">\n"
      "            <e9 xmlns:a=\"http://www.ietf.org\"></e9>\n"
      "         </e8>\n      </e7>\n   </e6>\n</doc>");
}

// Section 3.4, without what its DOCTYPE normalises.
TEST(CanonicalXml, OfCharactersIsThePublishedOne) {
  EXPECT_EQ(
      canonical(
          "<doc>\r\n   <text>First line&#x0d;&#10;Second line</text>\n   <value>&#x32;</value>\n"
          "   <compute><![CDATA[value>\"0\" && value<\"10\" ?\"valid\":\"error\"]]></compute>\n"
          "   <compute expr='value>\"0\" &amp;&amp; value&lt;\"10\" ?\"valid\":\"error\"'>valid</compute>\n"
          "   <norm attr=' &apos;   &#x20;&#13;&#xa;&#9;   &apos; '/>\n</doc>",
          kInclusive),
      "<doc>\n   <text>First line&#xD;\nSecond line</text>\n   <value>2</value>\n"
      "   <compute>value&gt;\"0\" &amp;&amp; value&lt;\"10\" ?\"valid\":\"error\"</compute>\n"
      "   <compute expr=\"value>&quot;0&quot; &amp;&amp; value&lt;&quot;10&quot; "
      "?&quot;valid&quot;:&quot;error&quot;\">valid</compute>\n"
      "   <norm attr=\" '    &#xD;&#xA;&#x9;   ' \"></norm>\n</doc>");
}

// Exclusive XML Canonicalization 1.0, section 2.2.
TEST(CanonicalXml, ExclusivelyTakesNothingFromAround) {
  const pugi::xml_document around = parse_xml(
      "<n0:pdu xmlns:n0='http://a.example' xml:lang='fr' xml:space='retain'>"
      "<n1:elem2 xmlns:n1='http://example.net' xml:lang='en'><n3:stuff "
      "xmlns:n3='ftp://example.org'/></n1:elem2>"
      "</n0:pdu>");
  const pugi::xml_node element = around.document_element().first_child();
  EXPECT_EQ(canonical_element(element, canonicalization_named(kInclusive).value()),
            "<n1:elem2 xmlns:n0=\"http://a.example\" xmlns:n1=\"http://example.net\" xml:lang=\"en\" "
            "xml:space=\"retain\"><n3:stuff xmlns:n3=\"ftp://example.org\"></n3:stuff></n1:elem2>");
  EXPECT_EQ(canonical_element(element, canonicalization_named(kExclusive).value()),
            "<n1:elem2 xmlns:n1=\"http://example.net\" xml:lang=\"en\">"
            "<n3:stuff xmlns:n3=\"ftp://example.org\"></n3:stuff></n1:elem2>");
}

// XML 1.0, section 2.11: the same document, as editors of other systems write it.
TEST(CanonicalXml, HasOneEndOfLinesEverywhere) {
  const std::string plain =
      "<?p one\ntwo\n\nthree\n?>\n<a b=\"1\n2\"><!-- one\ntwo --><?q\none\n?>one\ntwo"
      "<![CDATA[one\ntwo]]></a>\n<?r one\n?>";
  const std::string with_comments = std::string(kInclusive) + "#WithComments";
  EXPECT_EQ(canonical(plain, with_comments),
            "<?p one\ntwo\n\nthree\n?>\n<a b=\"1 2\"><!-- one\ntwo --><?q one\n?>one\ntwoone\ntwo</a>\n<?r "
            "one\n?>");
  for (const char* end : {"\r\n", "\r"}) {
    std::string other;
    for (const char c : plain) other += c == '\n' ? std::string(end) : std::string(1, c);
    EXPECT_EQ(canonical(other, with_comments), canonical(plain, with_comments))
        << (end[1] == 0 ? "CR" : "CRLF");
  }
}

TEST(CanonicalXml, RefusesWhatHasNone) {
  EXPECT_THAT(why_not_read("<a><b></a>"), HasSubstr("it is no XML"));
  EXPECT_THAT(why_not_read("<!DOCTYPE a [<!ENTITY e 'x'>]><a>&e;</a>"), HasSubstr("DOCTYPE"));
  EXPECT_THAT(why_not_read("<a/><b/>"), HasSubstr("one outermost element"));
  EXPECT_THAT(why_not_read("x<a/>"), HasSubstr("outside of its outermost element"));
  EXPECT_THAT(why_not_read("<a/>x"), HasSubstr("outside of its outermost element"));
  EXPECT_THAT(why_not_read("<p:a/>"), HasSubstr("nothing declares the prefix"));
  EXPECT_THAT(why_not_read("<a xmlns:p='urn:x' xmlns:q='urn:x' p:n='1' q:n='2'/>"),
              HasSubstr("stands twice"));
  EXPECT_THAT(why_not_read("<a xmlns:p=''/>"), HasSubstr("back"));
  // What the parser would pass over in silence.
  EXPECT_THAT(why_not_read(std::string("<a>good</a>\0EVIL<b>", 19)),
              HasSubstr("a character that XML does not have"));
  for (const char* reference : {"&#0;", "&#x0;", "&#x00;", "&#1;", "&#xD800;", "&#xFFFE;", "&#1114112;",
                                "&#4294967296;", "&#;", "&#x;", "&#-1;", "&#X41;"}) {
    EXPECT_THAT(why_not_read("<a>good" + std::string(reference) + "evil</a>"), HasSubstr("a reference to"))
        << reference;
    EXPECT_THAT(why_not_read("<a b='good" + std::string(reference) + "evil'/>"), HasSubstr("a reference to"))
        << reference;
  }
  for (const char* name : {"&nbsp;", "&AMP;", "& b;", "&;"})
    EXPECT_THAT(why_not_read("<a>" + std::string(name) + "</a>"), HasSubstr("which nothing declares"))
        << name;
  EXPECT_THAT(why_not_read("<a>AT&T</a>"), HasSubstr("a reference without end"));
  EXPECT_THAT(why_not_read("<a/>&#32;"), HasSubstr("outside of its outermost element"));
  EXPECT_THAT(why_not_read("<a/><![CDATA[ ]]>"), HasSubstr("outside of its outermost element"));
  EXPECT_THAT(why_not_read("<a b='<'/>"), HasSubstr("the value of an attribute"));
  EXPECT_THAT(why_not_read("<a>]]></a>"), HasSubstr("]]>"));
  EXPECT_THAT(why_not_read("<a>\x01</a>"), HasSubstr("a character that XML does not have"));
  EXPECT_THAT(why_not_read("<?xml version='1.0'?><?xml version='1.0' hidden='x'?><a/>"),
              HasSubstr("a declaration"));
  EXPECT_THAT(why_not_read("<a/><?xml version='1.0'?>"), HasSubstr("a declaration"));
  EXPECT_THAT(why_not_read("<?XML version='1.0'?><a/>"), HasSubstr("a declaration"));
  EXPECT_THAT(why_not_read(" <?xml version='1.0'?><a/>"), HasSubstr("a declaration"));
  EXPECT_THAT(why_not_read("<?xml version='1.0' hidden='x'?><a/>"), HasSubstr("its declaration is none"));
  EXPECT_THAT(why_not_read("<?xml version='1.0?><a b='?><c/>"), HasSubstr("XML \"1.0?><a b=\""));
  EXPECT_THAT(why_not_read("<?xml version='1.1'?><a/>"), HasSubstr("XML \"1.1\", and 1.0 alone is read"));
  std::string deep, many = "<a";
  for (int i = 0; i < 200; ++i) deep += "<a>";
  for (int i = 0; i < 200; ++i) deep += "</a>";
  for (int i = 0; i < 100; ++i) many += " n" + std::to_string(i) + "='x'";
  EXPECT_THAT(why_not_read(deep), HasSubstr("more than 100 others"));
  EXPECT_THAT(why_not_read(many + "/>"), HasSubstr("more than 64 attributes"));
}

// The parser would take many times the bytes of such a document.
TEST(CanonicalXml, OfMoreMarksThanAnyDocumentHasIsNotMade) {
  const auto many = [](const std::string& mark, std::size_t count) {
    std::string xml = "<a>";
    for (std::size_t i = 0; i < count; ++i) xml += mark;
    return xml + "</a>";
  };
  constexpr std::size_t kMost = kMostXmlMarks - 2;  // within the outermost element
  EXPECT_EQ(why_not_read(many("<b/>", kMost)), "");
  for (const char* mark : {"<b/>", "<!---->", "<?b?>", "<![CDATA[]]>"})
    EXPECT_THAT(why_not_read(many(mark, kMost + 1)), HasSubstr("more than 1000000 tags")) << mark;
  for (const char* marks : {"<b></b>", "<b c=''/>"}) {
    EXPECT_EQ(why_not_read(many(marks, kMost / 2)), "") << marks;
    EXPECT_THAT(why_not_read(many(marks, kMost / 2 + 1)), HasSubstr("more than 1000000 tags")) << marks;
  }
}

TEST(CanonicalXml, KeepsWhatLooksLikeAReferenceWhereItIsNone) {
  EXPECT_EQ(canonical("<?xml version='1.0' encoding='utf-8' standalone='no' ?><a b='&#x1F600;>'>"
                      "<!-- &nbsp; < --><?p &#0; <?><![CDATA[&nbsp;<b>]]>&#65;\xC3\xA9</a>",
                      kInclusive),
            "<a b=\"\xF0\x9F\x98\x80>\"><?p &#0; <?>&amp;nbsp;&lt;b&gt;A\xC3\xA9</a>");
}

// The parser knows few encodings, and takes the others for UTF-8.
TEST(CanonicalXml, OfAnotherEncodingIsNotMade) {
  EXPECT_THAT(why_not_read("<?xml version=\"1.0\" encoding=\"Shift_JIS\"?><a>\x8E\xE8</a>"),
              HasSubstr("it says that it is in \"Shift_JIS\", and UTF-8 alone is read"));
  for (const char* name : {"EUC-JP", "ISO-2022-JP", "windows-1252", "ISO-8859-1", "UTF-16"})
    EXPECT_THAT(why_not_read("<?xml version='1.0' encoding='" + std::string(name) + "'?><a/>"),
                HasSubstr(name));
  EXPECT_THAT(why_not_read(std::string("\xFF\xFE<\0a\0/\0>\0", 10)), HasSubstr("UTF-16"));
  EXPECT_THAT(why_not_read(std::string("\xFE\xFF\0<\0a\0/\0>", 10)), HasSubstr("UTF-16"));
  EXPECT_THAT(why_not_read("<?xml version='1.0' encoding='US-ASCII'?><a>\xC3\xA9</a>"),
              HasSubstr("US-ASCII"));
  for (const char* bytes : {"\x8E\xE8", "\xC0\x80", "\xE0\x80\x80", "\xF5\x80\x80\x80", "\xC3", "\x80"})
    EXPECT_THAT(why_not_read("<a>" + std::string(bytes) + "</a>"), HasSubstr("no UTF-8"));
  for (const char* bytes : {"\xED\xA0\x80", "\xEF\xBF\xBE", "\xF4\x90\x80\x80"})
    EXPECT_THAT(why_not_read("<a>" + std::string(bytes) + "</a>"), HasSubstr("that XML does not have"));
  EXPECT_EQ(why_not_read("\xEF\xBB\xBF<?xml version='1.0' encoding='Utf-8'?><a>\xE6\x89\x8B</a>"), "");
  EXPECT_EQ(why_not_read("<?xml version='1.0' encoding='us-ascii'?><a/>"), "");
}

// A namespace that is declared once and used by many siblings is written for each of them.
TEST(CanonicalXml, ThatWouldGrowWithoutBoundIsRefused) {
  std::string xml = "<a xmlns:p='urn:" + std::string(100'000, 'x') + "'>";
  for (int i = 0; i < 2'000; ++i) xml += "<p:b/>";
  EXPECT_THROW(canonical(xml + "</a>", kExclusive), Error);
}

/// A record of three chains as another program would write it: its parts are written in canonical form here,
/// so that their hashes need none of the code under test.
class XmlRecordTest : public ::testing::Test {
 protected:
  static constexpr const char* kData = "ledger of 2026";
  static constexpr const char* kMore = "a segment of it";
  static constexpr const char* kNamespace = " xmlns=\"urn:ietf:params:xml:ns:ers\"";

  XmlRecordTest() {
    for (const PlayedAuthority* authority : {&first_, &second_, &third_})
      trust_.add_trusted(bytes_of(authority->root_pem()), "root");
    begin_chain(HashAlgorithm::kSha256, first_.at("2026-11-01"));
    renew_time_stamp(second_.at("2031-11-01"));
    begin_chain(HashAlgorithm::kSha512, second_.at("2034-06-01"));
    renew_time_stamp(third_.at("2039-03-01"));
    begin_chain(HashAlgorithm::kSha3_512, third_.at("2044-05-01"));
  }

  [[nodiscard]] std::string record() const { return record_of(chains_); }
  [[nodiscard]] static std::string record_of(const std::vector<std::vector<std::string>>& chains) {
    return "<?xml version=\"1.0\"?>\n<EvidenceRecord Version=\"1.0\"" + std::string(kNamespace) + ">\n  " +
           sequence_of(chains, "") + "</EvidenceRecord>\n";
  }
  [[nodiscard]] RecordJudgement judge(const std::string& xml, const std::string& data = kData,
                                      const Policy* policy = nullptr) const {
    return XmlRecord::parse(xml).judge({object_of(data), object_of(kMore)},
                                       {.trust = &trust_, .policy = policy, .now = day("2046-11-01")});
  }

  static std::string uri_of(HashAlgorithm algorithm) {
    return algorithm == HashAlgorithm::kSha3_512
               ? "http://www.w3.org/2007/05/xmldsig-more#sha3-512"
               : "http://www.w3.org/2001/04/xmlenc#" + std::string(crypto::hash_name(algorithm));
  }
  static std::string in_base64(ByteView bytes) {
    return crypto::to_base64(bytes, crypto::Base64Padding::kPadded);
  }
  /// An ArchiveTimeStamp over these values and one of a stranger's.
  static std::string stamped(std::size_t order, HashAlgorithm algorithm, HashList values,
                             const Stamp& stamp) {
    const HashList stranger{hash_of(algorithm, "another record")};
    std::string tree;
    for (const HashList& list : {values, stranger}) {
      tree += "<Sequence Order=\"" + std::string(tree.empty() ? "1" : "2") + "\">";
      for (const Bytes& value : list) tree += "<DigestValue>" + in_base64(value) + "</DigestValue>";
      tree += "</Sequence>";
    }
    const Bytes token = stamp(algorithm, root_of(algorithm, {std::move(values), stranger}));
    return "<ArchiveTimeStamp Order=\"" + std::to_string(order) + "\"><HashTree>" + tree +
           "</HashTree><TimeStamp>" + inside_time_stamp(token) + "</TimeStamp></ArchiveTimeStamp>";
  }
  static std::string inside_time_stamp(ByteView token) {
    return "<TimeStampToken Type=\"RFC3161\">" + in_base64(token) + "</TimeStampToken>";
  }
  static std::string sequence_of(const std::vector<std::vector<std::string>>& chains,
                                 const std::string& declared) {
    std::string text = "<ArchiveTimeStampSequence" + declared + ">";
    for (std::size_t i = 0; i < chains.size(); ++i) {
      const std::string head = chains[i].front();
      text += "<ArchiveTimeStampChain Order=\"" + std::to_string(i + 1) + "\">" + head;
      for (std::size_t j = 1; j < chains[i].size(); ++j) text += chains[i][j];
      text += "</ArchiveTimeStampChain>";
    }
    return text + "</ArchiveTimeStampSequence>";
  }

  void begin_chain(HashAlgorithm algorithm, const Stamp& stamp,
                   const std::vector<std::string>& data = {kData, kMore}) {
    HashList values;
    for (const std::string& each : data) values.push_back(hash_of(algorithm, each));
    if (!chains_.empty()) values.push_back(hash_of(algorithm, sequence_of(chains_, kNamespace)));
    chains_.push_back({"<DigestMethod Algorithm=\"" + uri_of(algorithm) +
                       "\"></DigestMethod><CanonicalizationMethod Algorithm=\"" + kInclusive +
                       "\"></CanonicalizationMethod>"});
    algorithm_ = algorithm;
    chains_.back().push_back(stamped(1, algorithm, std::move(values), stamp));
  }
  void renew_time_stamp(const Stamp& stamp) {
    const std::string& before = chains_.back().back();
    const std::size_t from = before.find("<TimeStamp>") + 11;
    const std::string inside = before.substr(from, before.find("</TimeStamp>") - from);
    const Bytes value =
        hash_of(algorithm_, "<TimeStamp" + std::string(kNamespace) + ">" + inside + "</TimeStamp>");
    chains_.back().push_back(stamped(chains_.back().size(), algorithm_, {value}, stamp));
  }

  /// A record of one time-stamp over this alone; without a tree the token is over it.
  void stamp_alone(const std::string& data, bool has_tree = true) {
    constexpr HashAlgorithm kHash = HashAlgorithm::kSha256;
    const Stamp stamp = third_.at("2044-05-01");
    std::string stamped_once = stamped(1, kHash, {hash_of(kHash, data)}, stamp);
    if (!has_tree)
      stamped_once = "<ArchiveTimeStamp Order=\"1\"><TimeStamp>" +
                     inside_time_stamp(stamp(kHash, hash_of(kHash, data))) +
                     "</TimeStamp></ArchiveTimeStamp>";
    chains_ = {{"<DigestMethod Algorithm=\"" + uri_of(kHash) + "\"/><CanonicalizationMethod Algorithm=\"" +
                    kExclusive + "\"/>",
                stamped_once}};
  }
  /// Of the record over a file with these bytes.
  [[nodiscard]] RecordJudgement judge_file(const std::string& bytes) const {
    DataObject object = object_of(bytes);
    object.content = bytes_of(bytes);
    return XmlRecord::parse(record()).judge({object},
                                            {.trust = &trust_, .policy = nullptr, .now = day("2046-11-01")});
  }

  PlayedAuthority first_{"First", "2026-01-01", "2032-01-01"};
  PlayedAuthority second_{"Second", "2030-01-01", "2040-01-01"};
  PlayedAuthority third_{"Third", "2038-01-01", "2050-01-01"};
  timestamp::TrustStore trust_;
  HashAlgorithm algorithm_ = HashAlgorithm::kSha256;
  std::vector<std::vector<std::string>> chains_;  // each: what names its methods, then its time-stamps
};

TEST_F(XmlRecordTest, AfterTwentyYearsHolds) {
  const RecordJudgement judgement = judge(record());
  EXPECT_EQ(codes_of(judgement), "");
  EXPECT_EQ(judgement.time_stamps.size(), 5U);
  EXPECT_EQ(judgement.since(), day("2026-11-01"));
  EXPECT_EQ(judgement.newest(), day("2044-05-01"));
  EXPECT_TRUE(judgement.outside());
}

TEST_F(XmlRecordTest, MeansTheSameWrittenInAnotherWay) {
  std::string xml = record();
  xml.replace(xml.find("<DigestMethod "), 14, "<DigestMethod\r\n  ");
  xml.replace(xml.find("></DigestMethod>"), 16, "/>");
  EXPECT_EQ(codes_of(judge(xml)), "");
}

TEST_F(XmlRecordTest, OtherDataIsRefused) {
  EXPECT_THAT(codes_of(judge(record(), "ledger of 2025")), HasSubstr("record-data-not-covered"));
}

TEST_F(XmlRecordTest, APlaceForAnotherProgramsWordsIsCoveredToo) {
  std::string xml = record();
  xml.insert(xml.find("<ArchiveTimeStampChain"), "<!-- said later -->");
  EXPECT_EQ(codes_of(judge(xml)), "") << "this method leaves comments out";
  xml.insert(xml.find("<ArchiveTimeStampChain"), " ");
  EXPECT_THAT(codes_of(judge(xml)), HasSubstr("record-link-missing"));
}

TEST_F(XmlRecordTest, EveryLinkThatIsCutOutIsMissed) {
  for (std::size_t chain = 0; chain + 1 < chains_.size(); ++chain) {
    for (std::size_t i = 1; i < chains_[chain].size(); ++i) {
      auto cut = chains_;
      cut[chain].erase(cut[chain].begin() + static_cast<std::ptrdiff_t>(i));
      if (cut[chain].size() == 1) cut.erase(cut.begin() + static_cast<std::ptrdiff_t>(chain));
      for (auto& each : cut)
        for (std::size_t j = 1; j < each.size(); ++j) each[j].replace(25, 1, std::to_string(j));
      EXPECT_THAT(codes_of(judge(record_of(cut))), HasSubstr("record-link-missing")) << chain << " " << i;
    }
  }
}

TEST_F(XmlRecordTest, LinksThatChangePlacesAreRefused) {
  auto stamps = chains_, chains = chains_;
  std::swap(stamps[0][1], stamps[1][1]);
  EXPECT_THAT(codes_of(judge(record_of(stamps))), HasSubstr("record-imprint-differs"));
  std::swap(chains[0], chains[1]);
  EXPECT_THAT(codes_of(judge(record_of(chains))), HasSubstr("record-out-of-order"));
}

TEST_F(XmlRecordTest, ALinkThatCameTooLateIsRefused) {
  const Policy policy = Policy::parse(
      "[[algorithm]]\nname=\"sha256\"\nuntil=2030-01-01\n[[algorithm]]\nname=\"sha512\"\n"
      "[[algorithm]]\nname=\"sha3-512\"\n[[algorithm]]\nname=\"ecdsa\"\n",
      "policy.toml");
  EXPECT_THAT(codes_of(judge(record(), kData, &policy)), HasSubstr("record-renewed-too-late"));
}

TEST_F(XmlRecordTest, AHashTreeRenewalCoversTheDataItself) {
  auto without = chains_;
  without.resize(1);
  const Bytes chains = hash_of(HashAlgorithm::kSha512, sequence_of(without, kNamespace));
  without.push_back({chains_[1][0], stamped(1, HashAlgorithm::kSha512, {chains}, second_.at("2034-06-01"))});
  EXPECT_THAT(codes_of(judge(record_of(without))), HasSubstr("record-data-not-covered"));
}

TEST_F(XmlRecordTest, DataThatIsXmlIsHashedInItsCanonicalForm) {
  stamp_alone("<a b=\"1\"></a>");
  const RecordJudgement judgement = judge_file("<a  b='1'/>");
  EXPECT_EQ(codes_of(judgement), "");
  EXPECT_EQ(judgement.only_as_canonical, std::vector{true});
  EXPECT_EQ(codes_of(judge_file("<a b='2'/>")), "record-data-not-covered");
  EXPECT_EQ(codes_of(judge_file("<a b='1'>")), "record-data-not-read");
}

// What stands where the parser does not look is no part of what was there.
TEST_F(XmlRecordTest, DataWithMoreThanItsCanonicalFormSaysIsNotCovered) {
  stamp_alone("<a>good</a>");
  EXPECT_EQ(codes_of(judge_file("<a>good</a>")), "");
  for (const std::string& more :
       {std::string("<a>good</a>\0EVIL<b>", 19), std::string("<a>good&#0;evil hidden</a>"),
        std::string("<a>good</a><?xml hidden='evil'?>"), std::string("<a>good</a>\0", 12)})
    EXPECT_EQ(codes_of(judge_file(more)), "record-data-not-read") << more;
}

TEST_F(XmlRecordTest, DataInAnotherEncodingAccusesNobody) {
  stamp_alone("<a>\xE6\x89\x8B</a>");
  const RecordJudgement judgement =
      judge_file("<?xml version=\"1.0\" encoding=\"Shift_JIS\"?><a>\x8E\xE8</a>");
  EXPECT_EQ(codes_of(judgement), "record-data-not-read");
  EXPECT_EQ(judgement.standing(), Standing::kCouldNotCheck);
  EXPECT_THAT(
      judgement.problems.front().text,
      HasSubstr(" could not be read as XML, since it says that it is in \"Shift_JIS\", and UTF-8 alone is "
                "read, so whether archiveTimeStampSequence[0][0] covers it is not known"));
  EXPECT_EQ(codes_of(judge_file(std::string("\xFF\xFE<\0a\0/\0>\0", 10))), "record-data-not-read");
}

// Archives that take files for octets.
TEST_F(XmlRecordTest, DataThatIsXmlMayBeHashedAsItsBytes) {
  for (const std::string& file :
       {std::string("<a  b='1'/>"), std::string("<!DOCTYPE html><html>"),
        std::string("<?xml version=\"1.0\" encoding=\"Shift_JIS\"?><a>\x8E\xE8</a>"),
        std::string("\xFF\xFE<\0a\0/\0>\0", 10), std::string("<a>good</a>\0more", 16)}) {
    for (const bool has_tree : {true, false}) {
      stamp_alone(file, has_tree);
      const RecordJudgement judgement = judge_file(file);
      EXPECT_EQ(codes_of(judgement), "") << file << has_tree;
      EXPECT_EQ(judgement.only_as_canonical, std::vector{false});
      EXPECT_TRUE(judgement.time_stamps.front().imprint_fits);
    }
  }
}

TEST_F(XmlRecordTest, WithoutATreeTheTokenIsOverTheDataInEitherForm) {
  stamp_alone("<a b=\"1\"></a>", false);
  EXPECT_EQ(codes_of(judge_file("<a  b='1'/>")), "");
  EXPECT_EQ(codes_of(judge_file("<a  b='2'/>")), "record-imprint-differs");
  EXPECT_EQ(codes_of(judge_file("<a  b='1'>")), "record-data-not-read");
}

TEST_F(XmlRecordTest, ACanonicalFormIsMadeOnceForAllChainsThatMakeItInOneWay) {
  std::string file = "<a  b='1'/>";
  const std::string form = "<a b=\"1\"></a>";
  chains_.clear();
  begin_chain(HashAlgorithm::kSha512, second_.at("2034-06-01"), {form});
  begin_chain(HashAlgorithm::kSha512, third_.at("2039-03-01"), {form});
  DataObject object{"the file", nullptr, bytes_of(file)};
  // Its bytes are asked for with each chain. They change behind the first one, so that who would read them
  // again would find something else.
  int asked = 0;
  object.digest = [&](HashAlgorithm algorithm) {
    if (++asked == 2) file[7] = '2';
    return hash_of(algorithm, "no value of the record");
  };
  const auto judged = [&] {
    return codes_of(XmlRecord::parse(record()).judge(
        {object}, {.trust = &trust_, .policy = nullptr, .now = day("2046-11-01")}));
  };
  EXPECT_EQ(judged(), "");
  EXPECT_EQ(asked, 2);
  // Another judgement reads it anew.
  EXPECT_THAT(judged(), HasSubstr("record-data-not-covered"));
  // So does a chain that hashes in another way.
  file[7] = '1';
  asked = 0;
  chains_.clear();
  begin_chain(HashAlgorithm::kSha512, second_.at("2034-06-01"), {form});
  begin_chain(HashAlgorithm::kSha3_512, third_.at("2039-03-01"), {form});
  EXPECT_THAT(judged(), HasSubstr("record-data-not-covered"));
}

TEST_F(XmlRecordTest, ChainsAloneAreNoProofOfData) {
  auto without = chains_;
  without.resize(1);
  const Bytes chains = hash_of(HashAlgorithm::kSha512, sequence_of(without, kNamespace));
  without.push_back({chains_[1][0], stamped(1, HashAlgorithm::kSha512, {chains}, second_.at("2034-06-01"))});
  const RecordJudgement judgement =
      XmlRecord::parse(record_of(without))
          .judge({}, {.trust = &trust_, .policy = nullptr, .now = day("2034-07-01")});
  EXPECT_EQ(codes_of(judgement), "record-data-not-covered");
  EXPECT_EQ(judgement.standing(), Standing::kCouldNotCheck);
}

TEST_F(XmlRecordTest, ChainsAloneAreNoProofOfDataThatJoinsLaterEither) {
  chains_.clear();
  begin_chain(HashAlgorithm::kSha256, second_.at("2031-11-01"), {"of somebody else"});
  begin_chain(HashAlgorithm::kSha512, second_.at("2034-06-01"), {});
  begin_chain(HashAlgorithm::kSha3_512, third_.at("2039-03-01"), {kData});
  const RecordJudgement judgement = XmlRecord::parse(record()).judge(
      {object_of(kData)},
      {.trust = &trust_, .policy = nullptr, .now = day("2046-11-01"), .objects_may_join = true});
  EXPECT_EQ(codes_of(judgement), "record-data-not-covered");
  EXPECT_EQ(judgement.standing(), Standing::kCouldNotCheck);
  EXPECT_EQ(judgement.problems.front().place, "archiveTimeStampSequence[1][0]");
  EXPECT_THAT(judgement.problems.front().text, HasSubstr("may have joined later"));
}

TEST_F(XmlRecordTest, WhatIsNoneIsRefusedByPlaceAndReason) {
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string xml = record();
    return refusal_of(xml.replace(xml.find(from), from.size(), to));
  };
  EXPECT_THAT(refusal_of("<a/>"), HasSubstr("no evidence record in XML"));
  EXPECT_THAT(changed("ns:ers", "ns:err"), HasSubstr("no evidence record in XML"));
  EXPECT_THAT(changed("Version=\"1.0\"", "Version=\"2\""), HasSubstr("its version is \"2\""));
  EXPECT_THAT(changed("ArchiveTimeStampChain Order=\"1\"", "ArchiveTimeStampChain Order=\"2\""),
              HasSubstr("archiveTimeStampSequence: the Order \"2\""));
  EXPECT_THAT(changed("xml-c14n-20010315", "xml-c14n-29990315"),
              HasSubstr("archiveTimeStampSequence[0]: the canonicalization"));
  EXPECT_THAT(changed("Type=\"RFC3161\"", "Type=\"XMLENTRUST\""),
              HasSubstr("archiveTimeStampSequence[0][0]: its token is of the type \"XMLENTRUST\""));
  EXPECT_THAT(changed("<DigestValue>", "<DigestValue>!"), HasSubstr("is no base64"));
  EXPECT_THAT(changed("<Sequence Order=\"2\"><DigestValue>",
                      "<Sequence Order=\"2\"></Sequence><Sequence Order=\"3\"><DigestValue>"),
              HasSubstr("is empty"));
  EXPECT_THAT(refusal_of(std::string(5U << 20U, ' ')), HasSubstr("more than 4 MiB"));
}

}  // namespace
}  // namespace kiroku::evidence
