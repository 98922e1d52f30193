#include "server/store/store.h"

#include <exception>
#include <utility>

#include "server/store/connection.h"
#include "server/store/schema.h"

namespace trammel {

Store::Store(std::unique_ptr<StoreConnection> connection) : connection_(std::move(connection)) {}
Store::~Store() = default;

Result<std::unique_ptr<Store>> Store::open(const std::string& path) {
  auto lock = WriterLock::take(path);
  if (!lock) return tl::make_unexpected(lock.error());
  try {
    auto connection = std::make_unique<StoreConnection>(path, std::move(*lock));
    const Status ready = connection->exclusively([&path](SQLite::Database& d) { return prepare_file(d, path); });
    if (!ready) return tl::make_unexpected(ready.error());
    return std::unique_ptr<Store>(new Store(std::move(connection)));
  } catch (const std::exception& error) {
    return failure(ErrorCode::kInternal, "cannot be opened: {}", error.what()).in(path);
  }
}

}  // namespace trammel
