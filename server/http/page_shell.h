#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "server/http/exchange.h"

namespace trammel {

/// A page of the service: its title, its body as HTML, and after how many seconds it is read again
/// (0: never).
struct ServicePage {
  std::string title;
  std::string body;
  int again_after = 0;  ///< s
};
[[nodiscard]] HttpReply page_reply(const ServicePage& page, int code = 200);

/// A separate page (a model, a history), with links to the other pages above it. `last_check`: the
/// address of a model's last check; empty: none.
[[nodiscard]] HttpReply report_reply(const std::string& page, const std::string& cell,
                                     const std::string& last_check = "");
/// report_reply() for a page that an earlier version of the program may have written. Its scripts
/// run, but without access to anything else.
[[nodiscard]] HttpReply stored_page_reply(const std::string& page, const std::string& cell);

/// The page of a cell, whatever its name is.
[[nodiscard]] std::string cell_address(const std::string& cell);

/// `2026-11-22 14:03`, UTC; a dash where there is none.
[[nodiscard]] std::string shown_time(std::optional<std::int64_t> unix_s);
/// `3 days`, `2 h`.
[[nodiscard]] std::string shown_age(double seconds);

}  // namespace trammel
