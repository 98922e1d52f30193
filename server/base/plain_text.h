#pragma once

#include <cstddef>
#include <string>
#include <string_view>

/// The characters that names, ids and messages may hold. Whoever reads a name from outside checks
/// it here; code that shows a foreign text to people passes it through shown().
namespace trammel {

/// True if the bytes are UTF-8 (RFC 3629) without NUL.
[[nodiscard]] bool is_utf8(std::string_view text);
/// True if the text is UTF-8 and a terminal or a log shows it as it is. It must not contain control
/// characters (C0, DEL, C1), line or paragraph separators, or marks that change the direction of
/// writing. Invisible characters (zero width, fillers, tags, variant selectors) are excluded, since
/// two texts that differ only in them look alike. Code points that are not characters are excluded
/// as well.
[[nodiscard]] bool is_plain(std::string_view text);
/// True if the text is UTF-8 and its only control characters are tabs and line ends: the text of a
/// file.
[[nodiscard]] bool is_plain_lines(std::string_view text);

/// The text with everything that is not plain spelled out, as JSON spells it: `\u001b`, `\u009b`; a
/// byte that is no UTF-8 as `\xff`. Plain text stays as it is.
[[nodiscard]] std::string shown(std::string_view text);
/// shown(), but tabs and line feeds stay.
[[nodiscard]] std::string shown_lines(std::string_view text);
/// shown(), cut after `most_bytes`.
[[nodiscard]] std::string shown_short(std::string_view text, std::size_t most_bytes = 40);

}  // namespace trammel
