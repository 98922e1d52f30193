#include "server/dds/records/request_recorder.h"

#include <fcntl.h>
#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <utility>
#include <vector>

namespace trammel {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kQueueBytes = std::size_t{64} << 20;
constexpr std::size_t kFiles = 8;               // files that share the space, when all are full
constexpr std::uintmax_t kLeastOfAFile = 4096;  // smallest use of the disk by a file
constexpr int kNiceness = 5;
constexpr const char* kBegin = "requests-";
constexpr const char* kEnd = ".jsonl";

/// 0: it is none of ours.
std::int64_t number_of(const fs::path& file) {
  const std::string name = file.filename().string(), begin = kBegin;
  if (!name.starts_with(begin) || !name.ends_with(kEnd)) return 0;
  std::int64_t number = 0;
  std::from_chars(name.data() + begin.size(), name.data() + name.size(), number);
  return number;
}

/// Oldest first.
std::vector<std::pair<std::int64_t, fs::path>> files_in(const std::string& folder) {
  std::vector<std::pair<std::int64_t, fs::path>> files;
  std::error_code wrong;
  for (auto entry = fs::directory_iterator(folder, wrong);
       !wrong && entry != fs::directory_iterator(); entry.increment(wrong)) {
    if (const std::int64_t number = number_of(entry->path()); number > 0)
      files.emplace_back(number, entry->path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

fs::path path_of(const RecordOptions& options, std::int64_t number) {
  return fs::path(options.folder) / fmt::format("{}{:09}{}", kBegin, number, kEnd);
}

std::uintmax_t room_of(const RecordOptions& options) {
  return static_cast<std::uintmax_t>(options.max_mb) << 20;
}

std::uintmax_t taken_by(const fs::path& file) {
  std::error_code gone;
  const std::uintmax_t bytes = fs::file_size(file, gone);
  return gone ? 0 : std::max(bytes, kLeastOfAFile);
}

/// Lets the oldest files go until so many bytes more find room.
void make_room(const RecordOptions& options, std::uintmax_t bytes) {
  const auto files = files_in(options.folder);
  std::uintmax_t taken = bytes;
  for (const auto& [number, file] : files) taken += taken_by(file);
  for (const auto& [number, file] : files) {
    if (taken <= room_of(options)) return;
    taken -= taken_by(file);
    std::error_code unknown;
    fs::remove(file, unknown);
  }
}

/// For the daemon's user only from its first moment on; never a file that is there already.
bool make_file(const fs::path& path) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (file >= 0) ::close(file);
  return file >= 0;
}

Failure not_there(const RecordOptions& options) {
  return refused("requests cannot be recorded there")
      .in(options.folder)
      .of("record: folder")
      .next("name a folder that the daemon may write to");
}

}  // namespace

Status RequestRecorder::check(const RecordOptions& options) {
  std::error_code unknown;
  fs::path at = fs::absolute(options.folder, unknown);
  while (!options.folder.empty() && !fs::exists(at, unknown) && at.has_relative_path())
    at = at.parent_path();
  const bool is_usable = options.folder.empty() ||
                         (fs::is_directory(at, unknown) && ::access(at.c_str(), W_OK | X_OK) == 0);
  return is_usable ? Status() : not_there(options);
}

Result<std::unique_ptr<RequestRecorder>> RequestRecorder::open(const RecordOptions& options) {
  if (options.folder.empty()) return nullptr;
  std::error_code wrong;
  fs::create_directories(options.folder, wrong);
  if (wrong || ::access(options.folder.c_str(), W_OK | X_OK) != 0) return not_there(options);
  std::unique_ptr<RequestRecorder> recorder(new RequestRecorder(options));
  const auto files = files_in(options.folder);
  recorder->number_ = files.empty() ? 0 : files.back().first;
  RequestRecorder* self = recorder.get();
  recorder->thread_ = std::jthread([self](const std::stop_token& stop) { self->run(stop); });
  return recorder;
}

RequestRecorder::~RequestRecorder() {
  thread_.request_stop();
  if (thread_.joinable()) thread_.join();
}

void RequestRecorder::record(std::function<std::string()> line, std::size_t bytes) {
  {
    const MutexLock lock(mutex_);
    if (waiting_bytes_ + bytes > kQueueBytes) {
      ++dropped_;
      return;
    }
    waiting_.push_back({std::move(line), bytes});
    waiting_bytes_ += bytes;
  }
  changed_.notify_one();
}

void RequestRecorder::run(const std::stop_token& stop) {
  ::pthread_setname_np(::pthread_self(), "recorder");
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), kNiceness);  // this thread alone
  while (true) {
    Waiting next;
    {
      MutexLock lock(mutex_);
      changed_.wait(lock, stop, [this]() TRAMMEL_REQUIRES(mutex_) { return !waiting_.empty(); });
      if (waiting_.empty()) return;  // the recorder is about to stop
      next = std::move(waiting_.front());
      waiting_.pop_front();
    }
    write(next.line());
    const MutexLock lock(mutex_);
    waiting_bytes_ -= next.bytes;
  }
}

void RequestRecorder::write(const std::string& line) {
  const std::size_t bytes = line.size() + 1, share = room_of(options_) / kFiles;
  if (bytes > room_of(options_)) return void(++dropped_);
  if (!file_.is_open() || (file_bytes_ > 0 && file_bytes_ + bytes > share)) {
    make_room(options_, std::max(share, bytes));
    next_file();
  }
  file_ << line << '\n' << std::flush;
  if (file_) {
    file_bytes_ += bytes;
    return;
  }
  ++dropped_;
  give_up_file();
}

void RequestRecorder::next_file() {
  file_bytes_ = 0;
  bool made = false;
  do {
    made = make_file(path_of(options_, ++number_));
  } while (!made && errno == EEXIST);  // the name is in use
  file_ = made ? std::ofstream(path_of(options_, number_), std::ios::binary | std::ios::app)
               : std::ofstream();
}

void RequestRecorder::give_up_file() {
  file_ = std::ofstream();
  std::error_code unknown;
  if (file_bytes_ > 0) {
    fs::resize_file(path_of(options_, number_), file_bytes_, unknown);
  } else {
    fs::remove(path_of(options_, number_--), unknown);
  }
}

}  // namespace trammel
