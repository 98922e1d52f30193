#include "server/store/store_check.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <system_error>

#include "server/store/file_header.h"
#include "server/store/moved.h"
#include "server/store/open_database.h"
#include "server/store/open_to_read.h"
#include "server/store/store_place.h"
#include "server/store/writer_lock.h"

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic("SQLite format 3\0", 16);
constexpr std::size_t kHeader = 100;  // bytes
constexpr std::size_t kSchemaAt = 60, kApplicationAt = 68;

std::uint32_t big_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (const char c : bytes) value = value << 8 | static_cast<unsigned char>(c);
  return value;
}

Status check_folder(const fs::path& path) {
  std::error_code error;
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::exists(folder, error))
    return refused("its folder {} is not there", folder.string())
        .in(path.string())
        .next("create it, or name another");
  if (!fs::is_directory(folder, error))
    return refused("{} is no folder", folder.string()).in(path.string()).next("name another");
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    return refused("its folder {} cannot be written to: {}", folder.string(), std::strerror(errno))
        .in(path.string())
        .next("change its owner or its mode");
  return {};
}

/// Checks the header of a file that exists and is not empty. Ignores changes that are only in the
/// journal.
Status check_header(const fs::path& path) {
  std::string header(kHeader, '\0');
  std::ifstream in(path, std::ios::binary);
  if (!in.read(header.data(), static_cast<std::streamsize>(header.size())) ||
      !header.starts_with(kMagic))
    return refused("no store: not an SQLite file")
        .in(path.string())
        .next("name another, or move this one away");
  const auto application = big_endian(std::string_view(header).substr(kApplicationAt, 4));
  const auto schema = big_endian(std::string_view(header).substr(kSchemaAt, 4));
  std::error_code error;
  const bool in_journal =
      application == 0 && schema == 0 && fs::exists(path.string() + "-wal", error);
  if (in_journal) return {};
  if (application != static_cast<std::uint32_t>(kApplicationId))
    return refused("a database of another program (application id {:#x}, not {:#x})", application,
                   kApplicationId)
        .in(path.string())
        .of("application id")
        .with_value(application)
        .next("name another");
  if (schema > static_cast<std::uint32_t>(kSchemaVersion))
    return refused("schema {} is newer than this program's, limit {}", schema, kSchemaVersion)
        .in(path.string())
        .of("schema")
        .beyond(schema, kSchemaVersion)
        .next("start a newer one");
  return {};
}

Status check_file(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return {};
  if (!fs::is_regular_file(path, error))
    return refused("no store: not a file").in(path.string()).next("name another");
  if (::access(path.c_str(), R_OK | W_OK) != 0)
    return refused("cannot be read and written: {}", std::strerror(errno))
        .in(path.string())
        .next("change its owner or its mode");
  if (fs::file_size(path, error) == 0) return {};
  return check_header(path);
}

/// Any other fault of the file is seen when it is opened.
Status check_file_is_here(const fs::path& path) {
  std::error_code error;
  if (!fs::exists(path, error) || fs::file_size(path, error) == 0) return {};
  try {
    // Opens without its journal, since a look at the journal would leave traces. A store is moved
    // only while nobody serves it.
    SqliteDatabase file(immutable_uri(path.string()), SQLite::OPEN_READONLY | SQLite::OPEN_URI,
                        kBusyTimeout);
    return check_not_moved(file, path.string());
  } catch (const DatabaseError&) {
    return {};
  }
}

}  // namespace

Status check_store(const std::string& path) {
  if (is_postgres_url(path))
    return work_at(path, open_to_write, [&](Database& database) {
      return check_not_moved(database, spoken_place(path));
    });
  return check_folder(path)
      .and_then([&] { return check_file(path); })
      .and_then([&] { return WriterLock::look(path); })
      .and_then([&] { return check_file_is_here(path); });
}

}  // namespace trammel
