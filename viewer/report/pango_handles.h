// Cairo's and Pango's objects as unique pointers.
#pragma once

#include <memory>
#include <pango/pangocairo.h>

namespace kiroku::report {

struct FreePango {
  void operator()(cairo_surface_t* surface) const { cairo_surface_destroy(surface); }
  void operator()(cairo_t* canvas) const { cairo_destroy(canvas); }
  void operator()(cairo_font_options_t* options) const { cairo_font_options_destroy(options); }
  void operator()(PangoFontMap* map) const { g_object_unref(map); }
  void operator()(PangoContext* context) const { g_object_unref(context); }
  void operator()(PangoLayout* layout) const { g_object_unref(layout); }
  void operator()(PangoAttrList* attributes) const { pango_attr_list_unref(attributes); }
  void operator()(PangoFontDescription* description) const { pango_font_description_free(description); }
};
template <typename T>
using PangoHandle = std::unique_ptr<T, FreePango>;

}  // namespace kiroku::report
