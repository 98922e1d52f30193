#include "server/store/audit.h"

#include "server/base/hash.h"

namespace trammel {
namespace {

Failure broken(std::int64_t number, const std::string& how) {
  return failure(ErrorCode::kInternal, "audit row {}: {}", number, how).at_row(number);
}

}  // namespace

std::string hash_of(const AuditRow& row) {
  std::string content;
  for (const std::string& part :
       {std::to_string(row.number), std::to_string(row.at), row.who, row.cell, row.what,
        row.subject, row.before, row.after, row.why, row.request, row.hash_before})
    content += fmt::format("{}:{},", part.size(), part);
  if (!row.server.empty()) content += fmt::format("{}:{},", row.server.size(), row.server);
  return sha256_hex(content);
}

Status AuditChain::add(const AuditRow& row) {
  if (row.number != rows_ + 1)
    return broken(rows_ + 1, fmt::format("missing, row {} comes after {}", row.number, rows_));
  if (row.hash != hash_of(row)) return broken(row.number, "its content is not what was written");
  if (row.hash_before != hash_)
    return broken(row.number, "it was written after another row than the one before it");
  ++rows_;
  hash_ = row.hash;
  return {};
}

Status AuditChain::end(std::int64_t rows, const std::string& hash) const {
  if (rows > rows_) return broken(rows_ + 1, fmt::format("missing, {} rows were written", rows));
  if (rows < rows_ || hash != hash_) return broken(rows_, "the trail ended otherwise");
  return {};
}

}  // namespace trammel
