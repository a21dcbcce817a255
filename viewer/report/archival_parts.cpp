#include "viewer/report/archival_parts.h"

#include <memory>
#include <qpdf/Buffer.hh>
#include <qpdf/QPDF.hh>
#include <qpdf/QPDFEFStreamObjectHelper.hh>
#include <qpdf/QPDFEmbeddedFileDocumentHelper.hh>
#include <qpdf/QPDFFileSpecObjectHelper.hh>
#include <qpdf/QPDFPageDocumentHelper.hh>
#include <qpdf/QPDFWriter.hh>

namespace kiroku::report {
namespace {

/// The file as one that the whole document rests on (ISO 19005-3, 6.8 and annex E).
QPDFObjectHandle embed(QPDF& pdf, const ArchivalFile& file, const std::string& date) {
  QPDFEFStreamObjectHelper stream = QPDFEFStreamObjectHelper::createEFStream(pdf, file.bytes);
  stream.setSubtype(file.media_type).setModDate(date);
  QPDFFileSpecObjectHelper named = QPDFFileSpecObjectHelper::createFileSpec(pdf, file.name, stream);
  named.setDescription(file.description);
  QPDFObjectHandle object = named.getObjectHandle();
  object.replaceKey("/AFRelationship", QPDFObjectHandle::newName("/Source"));
  return object;
}

void make_links_printed(QPDF& pdf) {
  constexpr int kPrint = 4;
  for (QPDFPageObjectHelper& page : QPDFPageDocumentHelper(pdf).getAllPages()) {
    for (QPDFAnnotationObjectHelper& annotation : page.getAnnotations())
      annotation.getObjectHandle().replaceKey("/F", QPDFObjectHandle::newInteger(kPrint));
  }
}

/// Cairo leaves it to the default of ISO 32000-1, table 117, that a subset of TrueType maps each character
/// identifier to the glyph of that number; ISO 19005-3, 6.2.11.3.2, wants it said.
void say_how_glyphs_are_found(QPDF& pdf) {
  for (QPDFObjectHandle object : pdf.getAllObjects()) {
    if (object.isDictionaryOfType("/Font", "/CIDFontType2") && !object.hasKey("/CIDToGIDMap"))
      object.replaceKey("/CIDToGIDMap", QPDFObjectHandle::newName("/Identity"));
  }
}

}  // namespace

std::string add_archival_parts(const std::string& given, const ArchivalParts& parts) {
  QPDF pdf;
  pdf.setSuppressWarnings(true);
  pdf.processMemoryFile("the document", given.data(), given.size());
  QPDFObjectHandle catalogue = pdf.getRoot();

  QPDFObjectHandle profile = pdf.newStream(parts.profile);
  profile.getDict().replaceKey("/N", QPDFObjectHandle::newInteger(3));
  QPDFObjectHandle intent = QPDFObjectHandle::parse(
      "<< /Type /OutputIntent /S /GTS_PDFA1 /OutputConditionIdentifier (sRGB IEC61966-2.1) "
      "/Info (sRGB IEC61966-2.1) >>");
  intent.replaceKey("/DestOutputProfile", profile);
  catalogue.replaceKey("/OutputIntents", QPDFObjectHandle::newArray({pdf.makeIndirectObject(intent)}));

  QPDFObjectHandle producer = pdf.getTrailer().getKey("/Info").getKey("/Producer");
  QPDFObjectHandle metadata =
      pdf.newStream(parts.metadata(producer.isString() ? producer.getUTF8Value() : "cairo"));
  metadata.getDict().replaceKey("/Type", QPDFObjectHandle::newName("/Metadata"));
  metadata.getDict().replaceKey("/Subtype", QPDFObjectHandle::newName("/XML"));
  catalogue.replaceKey("/Metadata", metadata);

  make_links_printed(pdf);
  say_how_glyphs_are_found(pdf);

  if (!parts.files.empty()) {
    QPDFEmbeddedFileDocumentHelper embedded(pdf);
    QPDFObjectHandle associated = QPDFObjectHandle::newArray();
    for (const ArchivalFile& file : parts.files) {
      const QPDFObjectHandle object = embed(pdf, file, parts.date);
      embedded.replaceEmbeddedFile(file.name, QPDFFileSpecObjectHelper(object));
      associated.appendItem(object);
    }
    catalogue.replaceKey("/AF", associated);
  }

  QPDFWriter writer(pdf);
  writer.setOutputMemory();
  writer.setMinimumPDFVersion("1.7");
  writer.setDeterministicID(true);
  writer.write();
  const std::shared_ptr<Buffer> out = writer.getBufferSharedPointer();
  return {reinterpret_cast<const char*>(out->getBuffer()), out->getSize()};
}

}  // namespace kiroku::report
