#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace trammel {

/// The style that all pages share; it has a `<style>` element of its own.
[[nodiscard]] std::string_view page_style();
/// JavaScript: `view3d()` draws points and lines in space in a canvas, turned and zoomed by the
/// pointer.
[[nodiscard]] std::string_view view3d_script();

/// JavaScript: tables of kind `sorts` sort by a click on the name of a column.
[[nodiscard]] std::string_view sort_tables_script();

/// `2026-11-22`, UTC; a dash where no time is known (0 or less).
[[nodiscard]] std::string shown_day(std::int64_t unix_s);

/// Text for terminals, with um replaced by µm.
[[nodiscard]] std::string with_micro(std::string text);

}  // namespace trammel
