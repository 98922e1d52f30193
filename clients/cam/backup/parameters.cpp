#include "clients/cam/backup/parameters.h"

#include <algorithm>
#include <cctype>

namespace trammel::cam {

namespace {

/// Lines; one that ends in a backslash is joined to the next.
struct Line {
  std::string text;
  int number = 0;
};

std::vector<Line> joined_lines(std::string_view text) {
  std::vector<Line> lines;
  bool goes_on = false;
  int number = 0;
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find('\n', at), text.size());
    std::string_view line = text.substr(at, end - at);
    at = end + 1;
    ++number;
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ' || line.back() == '\t'))
      line.remove_suffix(1);
    const bool on = !line.empty() && line.back() == '\\';
    if (on) line.remove_suffix(1);
    if (goes_on)
      lines.back().text += " " + std::string(line);
    else
      lines.push_back({std::string(line), number});
    goes_on = on;
  }
  return lines;
}

bool is_blank(char c) { return c == ' ' || c == '\t'; }

/// `ROBOT:` alone on its line.
std::string header(const std::string& line) {
  if (line.size() < 2 || line.back() != ':') return "";
  const bool plain = std::all_of(line.begin(), line.end() - 1,
                                 [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; });
  return plain ? line.substr(0, line.size() - 1) : "";
}

void read_values(const std::string& line, ParameterInstance& instance) {
  std::size_t at = 0;
  const auto skip = [&] {
    while (at < line.size() && is_blank(line[at])) ++at;
  };
  const auto word = [&] {
    const std::size_t begin = at;
    while (at < line.size() && !is_blank(line[at])) ++at;
    return line.substr(begin, at - begin);
  };
  const auto is_attribute = [&] {
    return at + 1 < line.size() && line[at] == '-' &&
           std::isalpha(static_cast<unsigned char>(line[at + 1])) != 0;
  };
  for (skip(); at < line.size(); skip()) {
    if (!is_attribute()) {
      word();
      continue;
    }
    const std::string attribute = word().substr(1);
    skip();
    std::string value;
    if (at < line.size() && line[at] == '"') {
      const std::size_t end = std::min(line.find('"', at + 1), line.size());
      value = line.substr(at + 1, end - at - 1);
      at = std::min(end + 1, line.size());
    } else if (at < line.size() && !is_attribute()) {
      value = word();
    }
    instance.values.emplace(attribute, value);
  }
}

}  // namespace

std::vector<ParameterInstance> parameter_instances(std::string_view text) {
  std::vector<ParameterInstance> instances;
  std::string type;
  for (const Line& line : joined_lines(text)) {
    if (const std::string named = header(line.text); !named.empty()) {
      type = named;
      continue;
    }
    const std::size_t first = line.text.find_first_not_of(" \t");
    if (type.empty() || first == std::string::npos || line.text[first] != '-') continue;
    ParameterInstance instance{type, line.number, {}};
    read_values(line.text, instance);
    instances.push_back(std::move(instance));
  }
  return instances;
}

}  // namespace trammel::cam
