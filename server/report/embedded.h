#pragma once

#include <string_view>

/// Files that are part of the program, see embed.cmake.
namespace trammel::embedded {

extern const std::string_view chart_js;   ///< Chart.js 3, minified; MIT licence, its notice inside
extern const std::string_view page_css;   ///< the style of all pages
extern const std::string_view view3d_js;  ///< points and lines in space, turned and zoomed
extern const std::string_view
    model_page_html;  ///< the page of a model, with `{{...}}` where its content goes
extern const std::string_view diagnosis_page_html;  ///< the same of a diagnosis
extern const std::string_view history_page_html;    ///< the same of a cell through its versions
extern const std::string_view view_page_html;       ///< the same of a cell in space
extern const std::string_view sort_tables_js;       ///< tables that sort by a click

}  // namespace trammel::embedded
