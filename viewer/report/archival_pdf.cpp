#include "viewer/report/archival_pdf.h"

#include <algorithm>
#include <array>
#include <exception>
#include <lcms2.h>
#include <memory>
#include <pugixml.hpp>
#include <sstream>
#include <string>
#include <utility>

#include "base/error.h"
#include "viewer/report/archival_parts.h"

namespace kiroku::report {
namespace {

/// The sRGB profile of IEC 61966-2-1, as Little CMS makes it.
std::string srgb_profile() {
  const std::unique_ptr<void, decltype(&cmsCloseProfile)> profile(cmsCreate_sRGBProfile(), cmsCloseProfile);
  cmsUInt32Number size = 0;
  if (profile)
    cmsSetProfileVersion(profile.get(), 4.2);  // ISO 15076-1:2005, the newest that ISO 19005-3 names
  if (!profile || cmsSaveProfileToMem(profile.get(), nullptr, &size) == 0)
    throw Error("cannot write the document as PDF/A: Little CMS made no sRGB profile");
  std::string bytes(size, '\0');
  if (cmsSaveProfileToMem(profile.get(), bytes.data(), &size) == 0)
    throw Error("cannot write the document as PDF/A: Little CMS wrote no sRGB profile");
  // ICC.1:2010, 7.2.8: when the profile was made, six big-endian numbers of 16 bits. Little CMS says now, and
  // a document of the same content must be the same bytes: 2004-01-01 00:00:00.
  constexpr std::size_t kMade = 24;
  constexpr std::array<char, 12> kAlways{0x07, static_cast<char>(0xd4), 0, 1, 0, 1, 0, 0, 0, 0, 0, 0};
  std::ranges::copy(kAlways, bytes.begin() + kMade);
  return bytes;
}

/// "2026-08-06T10:00:00Z"
std::string xmp_date(UtcTime time) { return format_utc(time).substr(0, 19) + "Z"; }
/// "D:20260806100000Z" (ISO 32000-1, 7.9.4)
std::string pdf_date(UtcTime time) {
  std::string date = format_utc(time).substr(0, 19);
  std::erase_if(date, [](char c) { return c == '-' || c == ':' || c == 'T'; });
  return "D:" + date + "Z";
}

/// XMP (ISO 16684-1) that says what the document's information dictionary says.
std::string metadata_of(const Document& document, const std::string& producer) {
  pugi::xml_document xml;
  pugi::xml_node meta = xml.append_child("x:xmpmeta");
  meta.append_attribute("xmlns:x") = "adobe:ns:meta/";
  pugi::xml_node rdf = meta.append_child("rdf:RDF");
  rdf.append_attribute("xmlns:rdf") = "http://www.w3.org/1999/02/22-rdf-syntax-ns#";
  pugi::xml_node about = rdf.append_child("rdf:Description");
  about.append_attribute("rdf:about") = "";
  about.append_attribute("xmlns:dc") = "http://purl.org/dc/elements/1.1/";
  about.append_attribute("xmlns:xmp") = "http://ns.adobe.com/xap/1.0/";
  about.append_attribute("xmlns:pdf") = "http://ns.adobe.com/pdf/1.3/";
  about.append_attribute("xmlns:pdfaid") = "http://www.aiim.org/pdfa/ns/id/";
  const auto add = [&](const char* name, const std::string& value) {
    about.append_child(name).text().set(value.c_str());
  };
  const auto add_in = [&](const char* name, const char* container, const std::string& value) {
    pugi::xml_node item = about.append_child(name).append_child(container).append_child("rdf:li");
    if (std::string_view(container) == "rdf:Alt") item.append_attribute("xml:lang") = "x-default";
    item.text().set(value.c_str());
  };
  add("pdfaid:part", "3");
  add("pdfaid:conformance", "B");
  add("dc:format", "application/pdf");
  add_in("dc:title", "rdf:Alt", document.title + " · " + document.identifier);
  add_in("dc:creator", "rdf:Seq", document.author);
  add_in("dc:description", "rdf:Alt", document.subject);
  add("xmp:CreatorTool", document.program);
  add("xmp:CreateDate", xmp_date(document.made));
  add("xmp:ModifyDate", xmp_date(document.made));
  add("pdf:Producer", producer);
  std::ostringstream out;
  out << "<?xpacket begin=\"\xef\xbb\xbf\" id=\"W5M0MpCehiHzreSzNTczkc9d\"?>\n";
  xml.save(out, " ", pugi::format_default | pugi::format_no_declaration, pugi::encoding_utf8);
  out << "<?xpacket end=\"r\"?>";
  return out.str();
}

}  // namespace

Bytes make_archival(ByteView pdf, const Document& document) {
  ArchivalParts parts;
  parts.profile = srgb_profile();
  parts.metadata = [&](const std::string& producer) { return metadata_of(document, producer); };
  parts.date = pdf_date(document.made);
  for (const Attachment& file : document.attachments)
    parts.files.push_back({file.name, file.media_type, file.description, std::string(text_of(file.bytes))});
  try {
    return to_bytes(add_archival_parts(std::string(text_of(pdf)), parts));
  } catch (const Error&) {
    throw;
  } catch (
      const std::exception& error) {  // qpdf's own, and those of the standard library that it lets through
    throw Error(std::string("cannot write the document as PDF/A: qpdf says: ") + error.what());
  }
}

}  // namespace kiroku::report
