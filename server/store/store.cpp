#include "server/store/store.h"

#include <memory>
#include <utility>

#include "server/store/connection.h"

namespace trammel {

Store::Store(std::unique_ptr<StoreConnection> connection) : connection_(std::move(connection)) {}
Store::~Store() = default;

Result<std::unique_ptr<Store>> Store::open(const std::string& path) {
  auto lock = WriterLock::take(path);
  if (!lock) return tl::make_unexpected(lock.error());
  auto copies = std::make_unique<ServedCopies>(path);
  auto opened = open_database(path, *copies);
  if (!opened) return tl::make_unexpected(opened.error());
  return std::unique_ptr<Store>(
      new Store(std::make_unique<StoreConnection>(path, std::move(*lock), std::move(*opened), std::move(copies))));
}

}  // namespace trammel
