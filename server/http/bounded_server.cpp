#include "server/http/bounded_server.h"

#include <arpa/inet.h>
#include <httplib.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <deque>
#include <exception>
#include <map>
#include <thread>
#include <utility>
#include <vector>

#include "server/base/letters.h"
#include "server/base/mutex.h"
#include "server/http/deadline_stream.h"
#include "server/http/incoming.h"
#include "server/http/refusal.h"

namespace trammel {
namespace {

constexpr std::size_t kLongestUri = 2048;      // bytes
constexpr std::size_t kLongestPostPath = 512;  // bytes; the library matches it letter by letter
constexpr int kBacklog = 1024;                 // connections that wait to be accepted

constexpr const char* kTooMany =
    "HTTP/1.1 503 Service Unavailable\r\nContent-Length: 9\r\nContent-Type: "
    "text/plain\r\nRetry-After: 1\r\n"
    "Connection: close\r\n\r\ntoo many\n";

void send_away(int socket) {
  static_cast<void>(::send(socket, kTooMany, std::strlen(kTooMany), MSG_NOSIGNAL | MSG_DONTWAIT));
  close_with_words(socket);
}

/// Runs the work for a connection in the accepting thread; the work never waits.
class AtOnce final : public httplib::TaskQueue {
 public:
  void enqueue(std::function<void()> take) override { take(); }
  void shutdown() override {}
};

/// A bounded queue of connections with a complete request, and the threads that answer them.
class Workers {
 public:
  using Serve = std::function<void(int socket)>;

  Workers(std::size_t count, std::size_t most, Serve serve)
      : most_(most), serve_(std::move(serve)) {
    for (std::size_t i = 0; i < count; ++i)
      workers_.emplace_back([this](const std::stop_token& stop) { work(stop); });
  }
  ~Workers() {
    for (std::jthread& worker : workers_) worker.request_stop();
    workers_.clear();
    const MutexLock lock(mutex_);
    for (const int socket : waiting_) send_away(socket);
  }
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  /// False: there is no room.
  [[nodiscard]] bool take(int socket) {
    const MutexLock lock(mutex_);
    if (waiting_.size() >= most_) return false;
    waiting_.push_back(socket);
    came_.notify_one();
    return true;
  }

 private:
  void work(const std::stop_token& stop) {
    become_http_thread("http");
    for (;;) {
      int socket = -1;
      {
        MutexLock lock(mutex_);
        came_.wait(lock, stop, [this]() TRAMMEL_REQUIRES(mutex_) { return !waiting_.empty(); });
        if (stop.stop_requested()) return;
        socket = waiting_.front();
        waiting_.pop_front();
      }
      serve_(socket);
    }
  }

  const std::size_t most_;
  const Serve serve_;
  Mutex mutex_;
  Condition came_;
  std::deque<int> waiting_ TRAMMEL_GUARDED_BY(mutex_);
  std::vector<std::jthread> workers_;
};

/// `127.0.0.1:9464` and `localhost` name this host; another name, even one that resolves to it,
/// does not.
bool is_of_this_host(const std::string& host) {
  const std::string name = host.substr(0, host.rfind(':'));
  in_addr parsed{};
  const bool is_loopback =
      ::inet_pton(AF_INET, name.c_str(), &parsed) == 1 && ntohl(parsed.s_addr) >> 24 == 127;
  return name == "localhost" || is_loopback;
}

/// The first word of a request's path.
std::string first_word(const std::string& head) {
  const std::size_t slash = head.find('/');
  if (slash == std::string::npos) return {};
  return head.substr(slash + 1, head.find_first_of(" /?#\r", slash + 1) - slash - 1);
}

/// The words between the slashes of a path that is read already.
std::vector<std::string> words_of(const std::string& path) {
  std::vector<std::string> words;
  std::size_t at = 0;
  while (at < path.size()) {
    const std::size_t end = std::min(path.find('/', at), path.size());
    if (end > at) words.push_back(path.substr(at, end - at));
    at = end + 1;
  }
  return words;
}

constexpr const char* kPlain = "text/plain; charset=utf-8";

HttpAsk ask_in(const httplib::Request& request) {
  HttpAsk ask{words_of(request.path), {}, request.method == "POST" ? "POST" : "GET", {}, {}};
  for (const auto& [name, value] : request.params) ask.options[name] = value;
  for (const auto& [name, value] : request.headers) ask.headers[lower(name)] = value;
  return ask;
}

HttpReply guarded_reply(const HttpHandler& handler, const HttpAsk& ask) {
  try {
    return handler(ask);
  } catch (const std::exception& failed) {
    return {500, kPlain, std::string(failed.what()) + "\n"};
  }
}

bool is_post_below(const std::optional<HttpPosts>& posts, const httplib::Request& request) {
  return posts && request.method == "POST" && first_word(request.target) == posts->word;
}

/// In the form that fits the address: JSON below the word of `posts`, words elsewhere.
HttpReply refused_as(const HttpLimits& limits, const httplib::Request& request, int code,
                     const Failure& why) {
  if (limits.posts && first_word(request.target) == limits.posts->word)
    return refusal(code, why.value());
  return {code, kPlain, why.value().message + "\n"};
}

/// Why a request is not even looked at. A body must say how long it is and come as it is: the
/// library does not limit one in pieces or one that grows when it is unpacked.
std::optional<HttpReply> refused_request(const httplib::Request& request,
                                         const HttpLimits& limits) {
  const auto refused_with = [&](int code, ErrorCode kind, const char* why) {
    return refused_as(limits, request, code, failure(kind, "{}", why));
  };
  const bool posts = is_post_below(limits.posts, request);
  if (request.method != "GET" && request.method != "HEAD" && !posts) {
    HttpReply reply = refused_with(405, ErrorCode::kUsage, "nothing can be changed here");
    reply.headers["Allow"] = "GET, HEAD";
    return reply;
  }
  if (request.target.size() > kLongestUri || (posts && request.path.size() > kLongestPostPath))
    return refused_with(414, ErrorCode::kTooLarge, "the address is too long");
  if (limits.stays_here && !is_of_this_host(request.get_header_value("Host")))
    return refused_with(421, ErrorCode::kUsage, "ask for 127.0.0.1 or localhost");
  if (!posts) return std::nullopt;
  if (request.has_header("Transfer-Encoding") || !request.has_header("Content-Length"))
    return refused_with(411, ErrorCode::kUsage, "say Content-Length, and send no pieces");
  const std::string type = request.get_header_value("Content-Type");
  const std::string kind = type.substr(0, type.find(';'));
  if (request.has_header("Content-Encoding") ||
      (kind != "application/json" && kind != "application/octet-stream" && kind != "text/csv"))
    return refused_with(415, ErrorCode::kUsage,
                        "send application/json, text/csv or application/octet-stream, not packed");
  return limits.posts->admission ? limits.posts->admission(ask_in(request)) : std::nullopt;
}

/// True if the connection may have another request: the client wants it, and the answer is given
/// when all of this one has been read.
bool may_stay(const httplib::Request& request, const HttpLimits& limits) {
  if (request.version != "HTTP/1.1" || lower(request.get_header_value("Connection")) == "close" ||
      refused_request(request, limits))
    return false;
  const std::string length = request.get_header_value("Content-Length");
  if (request.method != "POST") return length.empty() && !request.has_header("Transfer-Encoding");
  std::size_t bytes = 0;
  const auto [end, error] = std::from_chars(length.data(), length.data() + length.size(), bytes);
  return error == std::errc() && end == length.data() + length.size() &&
         request.get_header_value_count("Content-Length") == 1 && bytes <= limits.posts->body;
}

void put_reply(HttpReply reply, httplib::Response& response) {
  response.status = reply.code;
  for (const auto& [name, value] : reply.headers) response.set_header(name, value);
  response.set_header("X-Content-Type-Options", "nosniff");
  response.set_header("Referrer-Policy", "no-referrer");
  response.set_header("Cache-Control", "no-store");
  response.set_content(std::move(reply.body), reply.type);
}

sockaddr_in socket_address(const std::string& address, std::uint16_t port) {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(port);
  ::inet_pton(AF_INET, address.c_str(), &to.sin_addr);
  return to;
}

}  // namespace

class BoundedServer::Running final : public httplib::Server {
 public:
  Running(const HttpLimits& limits, HttpHandler handler)
      : limits_(limits), handler_(std::move(handler)) {
    for (const std::string& word : limits_.apart)
      apart_[word] = std::make_unique<Workers>(
          1, limits_.waiting, [this](int socket) { serve(socket, limits_.reading); });
    if (limits_.posts)
      apart_[limits_.posts->word] = std::make_unique<Workers>(
          limits_.posts->workers, limits_.waiting, [this](int socket) { serve_and_keep(socket); });
    set_tcp_nodelay(true);
    set_keep_alive_timeout(Incoming::kIdle.count());  // what clients are told
    set_keep_alive_max_count(1'000'000);
    new_task_queue = [] { return new AtOnce; };
    // By default it would share the port with another listener.
    set_socket_options([](int socket) {
      const int yes = 1;
      ::setsockopt(socket, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
    });
    // Runs before the search for a route, whose regular expressions recurse too deep for a long
    // path.
    set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
      auto refused = refused_request(request, limits_);
      if (!refused && request.method == "POST")
        return HandlerResponse::Unhandled;  // the library reads its body, and calls post()
      put_reply(refused ? std::move(*refused) : guarded_reply(handler_, ask_in(request)), response);
      return HandlerResponse::Handled;
    });
    if (limits_.posts) take_posts();
  }
  ~Running() override {
    stop();
    thread_ = {};
    incoming_.stop();
  }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  /// The library lets five connections wait to be accepted.
  void let_many_wait() { ::listen(svr_sock_, kBacklog); }
  void listen_in_a_thread() {
    thread_ = std::jthread([this] {
      become_http_thread("http accept");
      listen_after_bind();
    });
  }

  [[nodiscard]] std::uint64_t shed() const { return shed_; }

 private:
  void take_posts() {
    set_payload_max_length(limits_.posts->body);
    Post(".*", [this](const httplib::Request& request, httplib::Response& response) {
      HttpAsk ask = ask_in(request);
      ask.body = request.body;
      put_reply(guarded_reply(handler_, ask), response);
    });
    set_error_handler([this](const httplib::Request& request, httplib::Response& response) {
      if (!response.body.empty() || response.status != 413) return;
      const std::size_t most = limits_.posts->body;
      put_reply(refused_as(limits_, request, 413,
                           failure(ErrorCode::kTooLarge, "more than {} bytes in one request", most)
                               .beyond(most, most)),
                response);
    });
  }

  bool process_and_close_socket(socket_t socket) override {
    incoming_.add(socket);
    return true;
  }
  void serve(int socket, std::chrono::milliseconds reading) {
    DeadlineStream stream(socket, reading, limits_.writing, limits_.tls);
    bool closed = false;
    process_request(stream, true, closed, take_plain);
  }
  /// Where a program asks again and again, a connection for each request would cost the most.
  void serve_and_keep(int socket) {
    DeadlineStream stream(socket, limits_.posts->reading, limits_.writing, limits_.tls);
    bool closed = false, stays = false;
    process_request(stream, limits_.tls != nullptr, closed, [&](httplib::Request& request) {
      take_plain(request);
      stays = !limits_.tls && may_stay(request, limits_);
      request.headers.erase("Connection");
      if (!stays) request.headers.emplace("Connection", "close");  // what the library goes by
    });
    if (const auto kept = stays ? stream.released() : std::nullopt) incoming_.keep(*kept);
  }
  /// Neither compressed nor in pieces: both would cost work.
  static void take_plain(httplib::Request& request) {
    request.headers.erase("Accept-Encoding");
    request.ranges.clear();
  }
  void give(int socket, const std::string& head) {
    const auto own =
        apart_.find(limits_.tls && limits_.posts ? limits_.posts->word : first_word(head));
    Workers& workers = own == apart_.end() ? workers_ : *own->second;
    if (!workers.take(socket)) shed(socket);
  }
  void shed(int socket) {
    ++shed_;
    send_away(socket);
  }

  const HttpLimits limits_;
  const HttpHandler handler_;
  std::atomic<std::uint64_t> shed_{0};
  // Outlives the workers, which give connections back to it; stops before they end.
  Incoming incoming_{limits_.waiting, limits_.reading,
                     [this](int socket, const std::string& head) { give(socket, head); },
                     [this](int socket) { shed(socket); }, limits_.tls != nullptr};
  Workers workers_{limits_.workers, limits_.waiting,
                   [this](int socket) { serve(socket, limits_.reading); }};
  std::map<std::string, std::unique_ptr<Workers>> apart_;  // by the first word of the path
  std::jthread thread_;
};

BoundedServer::BoundedServer(std::unique_ptr<Running> running) : running_(std::move(running)) {}

BoundedServer::~BoundedServer() = default;

std::uint64_t BoundedServer::shed() const { return running_->shed(); }

Result<std::unique_ptr<BoundedServer>> BoundedServer::start(const std::string& address,
                                                            std::uint16_t port,
                                                            const HttpLimits& limits,
                                                            HttpHandler handler) {
  TRY(check_http_address(address, port, limits.stays_here));
  auto running = std::make_unique<Running>(limits, std::move(handler));
  if (!running->bind_to_port(address, port))
    return failure(ErrorCode::kConflict, "{}:{} cannot be listened on", address, port)
        .of("port")
        .with_value(port);
  running->let_many_wait();
  running->listen_in_a_thread();
  while (!running->is_running()) std::this_thread::yield();  // stop() does nothing before
  return std::unique_ptr<BoundedServer>(new BoundedServer(std::move(running)));
}

Status check_http_address(const std::string& address, std::uint16_t port, bool stays_here) {
  if (stays_here && (!is_of_this_host(address) || address == "localhost"))
    return failure(ErrorCode::kUsage, "'{}' is not 127.x.x.x: pages and metrics stay on this host",
                   address)
        .of("address")
        .with_text(address);
  const int probe = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int yes = 1;
  ::setsockopt(probe, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  const sockaddr_in to = socket_address(address, port);
  const bool free = ::bind(probe, reinterpret_cast<const sockaddr*>(&to), sizeof(to)) == 0 &&
                    ::listen(probe, 1) == 0;
  const int why = errno;
  ::close(probe);
  if (free) return {};
  return failure(why == EADDRNOTAVAIL ? ErrorCode::kUsage : ErrorCode::kConflict,
                 "{}:{} cannot be listened on: {}", address, port, std::strerror(why))
      .of("port")
      .with_value(port)
      .next("give it another port, or end who has it");
}

}  // namespace trammel
