/// Reads a JSON object field by field, so that every error names the file, the field and the reason.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace sim {

/// Input that cannot be used: a file, a field or an option, named in what().
class InputError : public std::runtime_error {
  public:
    using std::runtime_error::runtime_error;
};

/// The parsed file. Throws InputError when it cannot be read, or is not JSON.
nlohmann::json read_json_file(const std::filesystem::path& path);

/// An interval of allowed values, with its unit for the error message.
struct Allowed {
    double min;
    double max;
    std::string_view unit = {};
};

class JsonFields {
  public:
    /// `place` names the object in errors, e.g. "approach.json: targets[0]". The JSON must outlive this.
    JsonFields(const nlohmann::json& object, std::string place);

    [[nodiscard]] bool has(std::string_view name);
    [[nodiscard]] double number(std::string_view name, Allowed allowed);
    [[nodiscard]] double number(std::string_view name, Allowed allowed, double otherwise);
    [[nodiscard]] std::int64_t integer(std::string_view name, Allowed allowed, std::int64_t otherwise);
    [[nodiscard]] std::string text(std::string_view name);
    [[nodiscard]] std::string text(std::string_view name, std::string_view otherwise);
    /// An object inside this one; its place is that of this one with the name appended.
    [[nodiscard]] JsonFields object(std::string_view name);
    /// The objects of an array; empty when there is no such field.
    [[nodiscard]] std::vector<JsonFields> objects(std::string_view name);
    /// [[a, b], ...] with each column in its own interval; empty when there is no such field.
    [[nodiscard]] std::vector<std::pair<double, double>> pairs(std::string_view name, Allowed first,
                                                               Allowed second);

    [[noreturn]] void fail(std::string_view name, const std::string& reason) const;
    /// Call last: a key that nobody asked for is an error, with the known ones named.
    void done() const;

  private:
    const nlohmann::json* find(std::string_view name);
    double checked(const nlohmann::json& value, std::string_view name, Allowed allowed) const;

    const nlohmann::json* json_;
    std::string place_;
    std::set<std::string, std::less<>> asked_;
};

}  // namespace sim
