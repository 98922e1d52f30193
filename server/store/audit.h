#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/base/result.h"

/// The trail of all changes of a store: who, when, what, before and after. Each row holds the hash
/// of its content and of the row before it, so a changed, removed or inserted row breaks the chain.
namespace trammel {

struct AuditRow {
  std::int64_t number = 0;  ///< 1, 2, 3... without a gap
  std::int64_t at = 0;      ///< Unix time, s
  std::string who;          ///< the requesting DDS participant, or `service` without one
  std::string cell;         ///< empty: of the store as a whole
  std::string what;     ///< `batch`, `activate`, `rollback`... as server/store/README.md lists them
  std::string subject;  ///< a batch, a job, a model: `batch lt-07`
  std::string before, after;
  std::string why;          ///< the stated reason; may be empty
  std::string request;      ///< the id under which it happened once; empty: none
  std::string hash_before;  ///< of the row before; empty: of the first row
  std::string hash;  ///< SHA-256 of all of the above, each as `bytes:text,`, and of `server` if it
                     ///< is set
  std::string server =
      {};  ///< the server that made the change; empty: the only server of the store, or a command
};

/// The value that `hash` of the row must have.
[[nodiscard]] std::string hash_of(const AuditRow& row);

/// The selection of rows.
struct AuditQuery {
  std::string cell = {};   ///< empty: all, and those of the store as a whole
  std::int64_t since = 0;  ///< Unix time, s
  std::size_t most = 0;    ///< the newest; 0: all
};

/// The rows of a trail, and whether they are valid: the trail is always verified as a whole.
struct AuditTrail {
  std::vector<AuditRow> rows;   ///< oldest first
  std::int64_t verified = 0;    ///< number of unchanged rows at the start of the whole trail
  std::optional<Error> broken;  ///< the first that is not (`row`), and how
};

/// Verifies the rows of a trail one after the other.
class AuditChain {
 public:
  /// Refuses (kInternal) a row that does not follow the one before in the chain.
  [[nodiscard]] Status add(const AuditRow& row);
  /// After the last row: refuses a trail that once had other rows at its end.
  [[nodiscard]] Status end(std::int64_t rows, const std::string& hash) const;
  [[nodiscard]] std::int64_t rows() const { return rows_; }

 private:
  std::int64_t rows_ = 0;
  std::string hash_;
};

/// Reads the trail of a store, a file or a database by its URL, without changing it, also while
/// services write it. Refuses a place that is not a store, and a store from before there was a
/// trail.
[[nodiscard]] Result<AuditTrail> read_audit(const std::string& place, const AuditQuery& query);

}  // namespace trammel
