// The page of a blinded reading.
#pragma once

#include <string_view>

namespace kiroku::study {

std::string_view page_html();
std::string_view page_css();
std::string_view page_js();

}  // namespace kiroku::study
