// PDF/A-3b, by the rules of veraPDF's profile for it (github.com/veraPDF/veraPDF-validation-profiles,
// PDF_A/PDFA-3B.xml): each test names those that it asks by clause and number. Rules about what our documents
// never have (forms, signatures, images of JPEG 2000, films) are asked by Forbids.
#ifndef __clang__  // which refuses qpdf's headers in C++20 (viewer/report/archival_parts.h)

#include "viewer/report/archival_pdf.h"

#include <functional>
#include <pugixml.hpp>
#include <qpdf/Buffer.hh>
#include <qpdf/QPDF.hh>
#include <qpdf/QPDFEmbeddedFileDocumentHelper.hh>
#include <qpdf/QPDFPageDocumentHelper.hh>
#include <set>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/utc_time.h"
#include "viewer/report/pdf_writer.h"

namespace kiroku::report {
namespace {

using testing::HasSubstr;

Document sample() {
  Document document;
  document.title = "Report & <title>";
  document.identifier = "20260805T091502Z-3f9c21ab";
  document.subtitle = "Recording";
  document.subject = "Verdict: INTACT";
  document.author = "佐藤 恵子";
  document.program = "kiroku 0.1.0";
  document.running_head = "Kiroku";
  document.running_foot = "foot";
  document.made = *parse_utc("2026-08-06T10:00:00Z");
  document.blocks = {Heading{1, "First"},
                     Paragraph{"Text, fi ligatures, 日本語, \xf0\x9f\x98\x80 and ✓ ✗."},
                     Statement{Tone::kGood, "INTACT", "sentence", {"remark"}},
                     Table{{{"a", 1}, {"b", 2}}, {{{"x"}, {"y", Tone::kBad, Face::kMono}}}},
                     PageBreak{},
                     Heading{2, "Second"},
                     Listing{{"sha256sum -c"}}};
  document.attachments = {
      {"00000042.note", "text/plain", "a note", to_bytes("kiroku/or3\n42\n")},
      {"報告.tsr", "application/timestamp-reply", "トークン", to_bytes(std::string(5'000, '\0'))}};
  return document;
}

class ArchivalPdf : public testing::Test {
 protected:
  ArchivalPdf() {
    pdf_.setSuppressWarnings(true);
    pdf_.processMemoryFile("sample", reinterpret_cast<const char*>(bytes_.data()), bytes_.size());
  }
  void SetUp() override { EXPECT_FALSE(pdf_.anyWarnings()); }

  /// Every dictionary of the file, streams' ones included.
  void each_dictionary(const std::function<void(QPDFObjectHandle)>& look) {
    for (QPDFObjectHandle object : pdf_.getAllObjects()) visit(object, look);
  }
  static void visit(QPDFObjectHandle object, const std::function<void(QPDFObjectHandle)>& look) {
    if (object.isStream()) object = object.getDict();
    if (object.isArray()) {
      for (QPDFObjectHandle item : object.aitems())
        if (!item.isIndirect()) visit(item, look);
    }
    if (!object.isDictionary()) return;
    look(object);
    for (const auto& [key, value] : object.ditems())
      if (!QPDFObjectHandle(value).isIndirect()) visit(value, look);
  }
  static std::string name_of(QPDFObjectHandle object, const char* key) {
    return object.getKey(key).isName() ? object.getKey(key).getName() : "";
  }

  Bytes bytes_ = write_pdf(sample());
  QPDF pdf_;
};

// 6.1.2-1, 6.1.2-2, 6.1.3-1, 6.1.3-2, 6.1.3-3
TEST_F(ArchivalPdf, HasHeaderAndTrailerOfItsKind) {
  const std::string_view text = text_of(bytes_);
  EXPECT_EQ(text.substr(0, 9), "%PDF-1.7\n");
  EXPECT_EQ(text[9], '%');
  for (std::size_t i = 10; i < 14; ++i) EXPECT_GT(static_cast<unsigned char>(text[i]), 127U);
  EXPECT_TRUE(text.ends_with("%%EOF\n"));
  EXPECT_TRUE(pdf_.getTrailer().getKey("/ID").isArray());
  EXPECT_FALSE(pdf_.getTrailer().hasKey("/Encrypt"));
}

// 6.2.3-1, 6.2.4.3-2, 6.2.4.3-4, 6.2.10-2: one output intent of RGB, which gives DeviceRGB and DeviceGray
// their meaning
TEST_F(ArchivalPdf, SaysWhatItsColoursMean) {
  QPDFObjectHandle intents = pdf_.getRoot().getKey("/OutputIntents");
  ASSERT_EQ(intents.getArrayNItems(), 1);
  QPDFObjectHandle intent = intents.getArrayItem(0);
  EXPECT_EQ(name_of(intent, "/S"), "/GTS_PDFA1");
  QPDFObjectHandle profile = intent.getKey("/DestOutputProfile");
  EXPECT_EQ(profile.getDict().getKey("/N").getIntValue(), 3);
  const auto data = profile.getStreamData();
  const std::string_view icc(reinterpret_cast<const char*>(data->getBuffer()), data->getSize());
  ASSERT_GT(icc.size(), 128U);
  EXPECT_EQ(static_cast<int>(icc[8]), 4);  // major version: below 5
  EXPECT_EQ(icc.substr(12, 4), "mntr");
  EXPECT_EQ(icc.substr(16, 4), "RGB ");
  each_dictionary([](QPDFObjectHandle object) {
    for (const char* key : {"/ColorSpace", "/CS"}) EXPECT_NE(name_of(object, key), "/DeviceCMYK");
  });
}

// 6.6.2.1-1 to -5, 6.6.2.3.1-1, 6.6.4-1 to -5
TEST_F(ArchivalPdf, ClaimsItsPartAndLevelInXmp) {
  QPDFObjectHandle metadata = pdf_.getRoot().getKey("/Metadata");
  EXPECT_EQ(name_of(metadata.getDict(), "/Type"), "/Metadata");
  EXPECT_EQ(name_of(metadata.getDict(), "/Subtype"), "/XML");
  EXPECT_FALSE(metadata.getDict().hasKey("/Filter"));
  const auto data = metadata.getStreamData();
  const std::string xmp(reinterpret_cast<const char*>(data->getBuffer()), data->getSize());
  EXPECT_EQ(xmp.find("bytes="), std::string::npos);
  EXPECT_EQ(xmp.find("encoding="), std::string::npos);
  pugi::xml_document xml;
  ASSERT_TRUE(xml.load_buffer(xmp.data(), xmp.size(), pugi::parse_default, pugi::encoding_utf8));
  const pugi::xml_node about = xml.select_node("//rdf:Description").node();
  EXPECT_STREQ(about.attribute("xmlns:pdfaid").value(), "http://www.aiim.org/pdfa/ns/id/");
  EXPECT_STREQ(about.child("pdfaid:part").text().get(), "3");
  EXPECT_STREQ(about.child("pdfaid:conformance").text().get(), "B");
  // It says what the information dictionary says.
  QPDFObjectHandle info = pdf_.getTrailer().getKey("/Info");
  EXPECT_EQ(about.child("dc:title").child("rdf:Alt").child("rdf:li").text().get(),
            info.getKey("/Title").getUTF8Value());
  EXPECT_EQ(info.getKey("/Title").getUTF8Value(), "Report & <title> · 20260805T091502Z-3f9c21ab");
  EXPECT_EQ(about.child("dc:creator").child("rdf:Seq").child("rdf:li").text().get(),
            info.getKey("/Author").getUTF8Value());
  EXPECT_EQ(info.getKey("/Author").getUTF8Value(), "佐藤 恵子");
  EXPECT_EQ(about.child("pdf:Producer").text().get(), info.getKey("/Producer").getUTF8Value());
  EXPECT_STREQ(about.child("xmp:CreateDate").text().get(), "2026-08-06T10:00:00Z");
  const std::set<std::string> predefined{
      "pdfaid:part",    "pdfaid:conformance", "dc:format",      "dc:title",       "dc:creator",
      "dc:description", "xmp:CreatorTool",    "xmp:CreateDate", "xmp:ModifyDate", "pdf:Producer"};
  for (const pugi::xml_node property : about.children()) EXPECT_TRUE(predefined.contains(property.name()));
}

// 6.2.11.2-1 to -7, 6.2.11.3.1-1, 6.2.11.3.2-1, 6.2.11.4.1-1
TEST_F(ArchivalPdf, EmbedsEveryFont) {
  int fonts = 0;
  each_dictionary([&](QPDFObjectHandle font) {
    if (name_of(font, "/Type") != "/Font") return;
    const std::string kind = name_of(font, "/Subtype");
    EXPECT_TRUE(kind == "/Type0" || kind == "/CIDFontType2" || kind == "/CIDFontType0" ||
                kind == "/TrueType" || kind == "/Type1" || kind == "/Type3")
        << kind;
    ++fonts;
    if (kind == "/Type3") return;  // its glyphs are drawings of the file's own
    EXPECT_FALSE(name_of(font, "/BaseFont").empty());
    if (kind == "/Type0") {
      EXPECT_TRUE(name_of(font, "/Encoding") == "/Identity-H" || name_of(font, "/Encoding") == "/Identity-V");
      EXPECT_EQ(font.getKey("/DescendantFonts").getArrayNItems(), 1);
      return;
    }
    QPDFObjectHandle described = font.getKey("/FontDescriptor");
    ASSERT_TRUE(described.isDictionary()) << name_of(font, "/BaseFont");
    EXPECT_TRUE(described.hasKey("/FontFile") || described.hasKey("/FontFile2") ||
                described.hasKey("/FontFile3"));
    EXPECT_FALSE(described.hasKey("/CIDSet"));
    EXPECT_TRUE(kind != "/CIDFontType2" || font.hasKey("/CIDToGIDMap"));
    if (kind == "/TrueType" || kind == "/Type1") {
      const auto first = font.getKey("/FirstChar").getIntValue(),
                 last = font.getKey("/LastChar").getIntValue();
      EXPECT_EQ(font.getKey("/Widths").getArrayNItems(), last - first + 1);
    }
  });
  EXPECT_GE(fonts, 3);
}

// 6.2.11.8-1: text never shows glyph 0, which is .notdef. Characters that no font has are drawn as boxes.
TEST_F(ArchivalPdf, ShowsNoGlyphThatIsNone) {
  class Shown : public QPDFObjectHandle::ParserCallbacks {
   public:
    void handleObject(QPDFObjectHandle object, size_t /*offset*/, size_t /*length*/) override {
      if (object.isString()) strings.push_back(object.getStringValue());
      if (object.isArray())
        for (QPDFObjectHandle item : object.aitems())
          if (item.isString()) strings.push_back(item.getStringValue());
    }
    void handleEOF() override {}
    std::vector<std::string> strings;
  };
  std::size_t glyphs = 0;
  for (QPDFPageObjectHelper& page : QPDFPageDocumentHelper(pdf_).getAllPages()) {
    Shown shown;
    page.parseContents(&shown);
    for (const std::string& text : shown.strings) {
      if (text.size() % 2 != 0) continue;  // of a font of single bytes
      for (std::size_t i = 0; i < text.size(); i += 2, ++glyphs)
        EXPECT_FALSE(text[i] == 0 && text[i + 1] == 0);
    }
  }
  EXPECT_GT(glyphs, 50U);
}

// 6.3.1-1, 6.3.2-1, 6.3.2-2, 6.5.1-1
TEST_F(ArchivalPdf, HasNoAnnotationThatIsNotPrinted) {
  each_dictionary([](QPDFObjectHandle object) {
    if (name_of(object, "/Type") == "/Annot") {
      EXPECT_EQ(name_of(object, "/Subtype"), "/Link");
      ASSERT_TRUE(object.getKey("/F").isInteger());
      EXPECT_EQ(object.getKey("/F").getIntValue() & 0x27, 4);
    }
    if (name_of(object, "/Type") == "/Action" || object.hasKey("/S")) {
      for (const char* refused : {"/Launch", "/JavaScript", "/Sound", "/Movie", "/ImportData", "/Hide"})
        EXPECT_NE(name_of(object, "/S"), refused);
    }
  });
}

// 6.8-1 to -4
TEST_F(ArchivalPdf, CarriesItsFilesAsAssociatedOnes) {
  const Document document = sample();
  const auto files = QPDFEmbeddedFileDocumentHelper(pdf_).getEmbeddedFiles();
  ASSERT_EQ(files.size(), document.attachments.size());
  std::set<QPDFObjGen> associated;
  for (QPDFObjectHandle item : pdf_.getRoot().getKey("/AF").aitems()) associated.insert(item.getObjGen());
  for (const Attachment& file : document.attachments) {
    ASSERT_TRUE(files.contains(file.name)) << file.name;
    QPDFFileSpecObjectHelper& named = *files.at(file.name);
    QPDFObjectHandle object = named.getObjectHandle();
    EXPECT_TRUE(associated.contains(object.getObjGen()));
    EXPECT_EQ(name_of(object, "/AFRelationship"), "/Source");
    EXPECT_TRUE(object.hasKey("/F") && object.hasKey("/UF"));
    EXPECT_EQ(named.getFilename(), file.name);
    EXPECT_EQ(named.getDescription(), file.description);
    QPDFEFStreamObjectHelper stream(named.getEmbeddedFileStream());
    EXPECT_EQ(stream.getSubtype(), file.media_type);
    EXPECT_EQ(stream.getModDate(), "D:20260806100000Z");
    const auto data = named.getEmbeddedFileStream().getStreamData();
    EXPECT_EQ(Bytes(reinterpret_cast<const std::byte*>(data->getBuffer()),
                    reinterpret_cast<const std::byte*>(data->getBuffer()) + data->getSize()),
              file.bytes);
  }
}

// 6.1.7.1-3, 6.1.7.2-1, 6.1.12-1, 6.1.13-3, -4, 6.2.5-1 to -3, 6.2.8-1 to -3, 6.2.9-1 to
// -3, 6.2.10-1, 6.4.1-1 to -3, 6.4.2-2, 6.5.2-1, -2, 6.9-1, 6.10-1, -2, 6.11-1
TEST_F(ArchivalPdf, Forbids) {
  for (const char* key :
       {"/AcroForm", "/Perms", "/AA", "/NeedsRendering", "/OCProperties", "/Requirements", "/OpenAction"})
    EXPECT_FALSE(pdf_.getRoot().hasKey(key)) << key;
  EXPECT_FALSE(pdf_.getRoot().getKey("/Names").hasKey("/AlternatePresentations"));
  each_dictionary([](QPDFObjectHandle object) {
    for (const char* key : {"/FFilter", "/FDecodeParms", "/TR", "/TR2", "/HTP", "/Alternates", "/OPI", "/PS",
                            "/PresSteps", "/Ref", "/XFA"})
      EXPECT_FALSE(object.hasKey(key)) << key;
    EXPECT_NE(name_of(object, "/Filter"), "/LZWDecode");
    EXPECT_NE(name_of(object, "/Filter"), "/Crypt");
    EXPECT_FALSE(object.getKey("/Interpolate").isBool() && object.getKey("/Interpolate").getBoolValue());
    EXPECT_TRUE(!object.getKey("/BM").isName() || name_of(object, "/BM") == "/Normal");
    for (const auto& [key, value] : object.ditems()) {
      EXPECT_LE(key.size(), 128U);
      QPDFObjectHandle held(value);
      EXPECT_TRUE(!held.isString() || held.getStringValue().size() < 32'768U);
    }
  });
}

TEST_F(ArchivalPdf, IsTheSameBytesAgainAndNotOfOtherContent) {
  EXPECT_EQ(bytes_, write_pdf(sample()));
  Document other = sample();
  other.attachments[0].bytes.push_back(std::byte{1});
  EXPECT_NE(bytes_, write_pdf(other));
}

TEST(ArchivalPdfOf, BytesThatAreNoPdfIsRefusedInASentence) {
  EXPECT_THROW(make_archival(to_bytes("no pdf"), sample()), Error);
}

}  // namespace
}  // namespace kiroku::report

#endif
