#include "clients/cli/text/audit_text.h"

#include <ctime>

#include "server/base/plain_text.h"

namespace trammel::cli {

namespace {

/// `2026-11-21T14:03:22Z`.
std::string time_text(std::int64_t unix_s) {
  const std::time_t time = unix_s;
  std::tm parts{};
  if (::gmtime_r(&time, &parts) == nullptr) return "-";
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", parts.tm_year + 1900, parts.tm_mon + 1,
                     parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec);
}

std::string change_text(const AuditRow& row) {
  if (row.before.empty()) return row.after;
  return row.before + " -> " + row.after;
}

std::string row_text(const AuditRow& row) {
  std::string text =
      fmt::format("{:>6} {} {}{}: {}", row.number, time_text(row.at),
                  row.cell.empty() ? "" : "cell " + row.cell + ", ", row.what, row.subject);
  if (const std::string change = change_text(row); !change.empty()) text += ": " + change;
  text += ", by " + row.who;
  if (!row.server.empty()) text += " on " + row.server;
  if (!row.why.empty()) text += " (" + row.why + ")";
  return shown(text) + "\n";
}

}  // namespace

std::string audit_text(const AuditTrail& trail, const std::string& where) {
  std::string text;
  for (const AuditRow& row : trail.rows) text += row_text(row);
  if (trail.broken) return text;
  return text + fmt::format("{}: all {} rows are as they were written\n", where, trail.verified);
}

}  // namespace trammel::cli
