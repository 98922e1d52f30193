#include "server/store/database/database.h"

namespace trammel {
namespace {

std::string spoken(const DatabaseError& error) {
  return error.code().empty() ? std::string(error.what())
                              : fmt::format("{} ({})", error.what(), error.code());
}

}  // namespace

Failure failure_of(const DatabaseError& error, const std::string& place) {
  using Kind = DatabaseError::Kind;
  switch (error.kind()) {
    case Kind::kAway:
      return failure(ErrorCode::kBusy, "{}", spoken(error))
          .in(place)
          .next("it is tried again by itself; ask again later");
    case Kind::kAgain:
      return failure(ErrorCode::kBusy, "others change the same: {}", spoken(error))
          .in(place)
          .next("ask again");
    case Kind::kUnknown:
      return failure(ErrorCode::kBusy, "whether the change was made is not known: {}",
                     spoken(error))
          .in(place)
          .next("ask again under the same id, on any server");
    case Kind::kRefused:
      return refused("{}", spoken(error))
          .in(place)
          .next("let the role use the store: trammel store init --grant ROLE, as its owner");
    case Kind::kBadValue:
      return refused("{}", spoken(error)).in(place);
    case Kind::kOther:
      break;
  }
  return failure(ErrorCode::kInternal, "{}", spoken(error)).in(place);
}

Transaction::Transaction(Database& database, For what) : database_(database) {
  database_.last_.clear();
  database_.begin(what == For::kWriting);
}

Transaction::~Transaction() {
  database_.last_.clear();
  if (open_) database_.roll_back();
}

void Transaction::do_last() {
  const auto last = std::exchange(database_.last_, {});
  for (const auto& work : last) work(database_);
}

void Transaction::commit() {
  do_last();
  database_.commit();
  open_ = false;
}

std::int64_t integer_of(Database& database, const char* sql) {
  Rows row = database.run(sql, Database::Values());
  return row.next() ? row.integer64(0) : 0;
}

std::string text_of(Database& database, const char* sql) {
  Rows row = database.run(sql, Database::Values());
  return row.next() ? row.text(0) : "";
}

}  // namespace trammel
