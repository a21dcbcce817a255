// The part of archival_pdf.h that speaks to qpdf. In C++17 and apart from all else: Clang refuses qpdf's
// headers (11.3, JSON.hh) in C++20. For archival_pdf.cpp alone. Thread-safe.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace kiroku::report {

struct ArchivalFile {
  std::string name, media_type, description, bytes;
};
struct ArchivalParts {
  std::string profile;                                               // ICC, of three components
  std::function<std::string(const std::string& producer)> metadata;  // XMP; given what the PDF says wrote it
  std::string date;                                                  // of the files, as PDF writes it
  std::vector<ArchivalFile> files;
};

/// The PDF with these in it. Throws std::exception for what is no PDF.
std::string add_archival_parts(const std::string& pdf, const ArchivalParts& parts);

}  // namespace kiroku::report
