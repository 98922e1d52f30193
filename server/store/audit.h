#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

/// The trail of all changes of a store: who, when, what, before and after. Each row holds the hash
/// of its content and of the row before it, so that no row can be changed, taken out or put in
/// without the rest showing it.
namespace trammel {

struct AuditRow {
  std::int64_t number = 0;  ///< 1, 2, 3... without a gap
  std::int64_t at = 0;      ///< Unix time, s
  std::string who;          ///< the DDS participant that asked, or `service` where nobody did
  std::string cell;         ///< empty: of the store as a whole
  std::string what;     ///< `batch`, `activate`, `rollback`... as server/store/README.md lists them
  std::string subject;  ///< a batch, a job, a model: `batch lt-07`
  std::string before, after;
  std::string why;          ///< what was said of it; may be empty
  std::string request;      ///< the id under which it happened once; empty: none
  std::string hash_before;  ///< of the row before; empty: of the first row
  std::string hash;  ///< SHA-256 of all of the above, each as `bytes:text,`, and of `server` where
                     ///< there is one
  std::string server =
      {};  ///< that made the change; empty: the one that has the store alone, or a command
};

/// The value that `hash` of the row must have.
[[nodiscard]] std::string hash_of(const AuditRow& row);

/// Which rows are asked for.
struct AuditQuery {
  std::string cell = {};   ///< empty: all, and those of the store as a whole
  std::int64_t since = 0;  ///< Unix time, s
  std::size_t most = 0;    ///< the newest; 0: all
};

/// The rows of a trail, and whether it can be believed: it is always verified as a whole.
struct AuditTrail {
  std::vector<AuditRow> rows;  ///< oldest first
  std::int64_t verified =
      0;  ///< rows of the whole trail, from the first one on, that are as they were written
  std::optional<Error> broken;  ///< the first that is not (`row`), and how
};

/// Takes the rows of a trail one after the other.
class AuditChain {
 public:
  /// Refuses (kInternal) a row that is not what was written after the one before.
  [[nodiscard]] Status add(const AuditRow& row);
  /// After the last row: refuses a trail that once had other rows at its end.
  [[nodiscard]] Status end(std::int64_t rows, const std::string& hash) const;
  [[nodiscard]] std::int64_t rows() const { return rows_; }

 private:
  std::int64_t rows_ = 0;
  std::string hash_;
};

/// The trail of a store, a file or a database by its URL, read without changing it, also while
/// services write it. Refuses what is no store, or one of before there was a trail.
[[nodiscard]] Result<AuditTrail> read_audit(const std::string& place, const AuditQuery& query);

}  // namespace trammel
