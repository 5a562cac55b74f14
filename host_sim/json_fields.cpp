#include "host_sim/json_fields.hpp"

#include <cmath>
#include <cstdint>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

namespace sim {

namespace {

std::string shortest(double value) {
    std::ostringstream out;
    out << value;
    return out.str();
}

}  // namespace

nlohmann::json read_json_file(const std::filesystem::path& path) {
    std::ifstream file(path);
    if (!file || std::filesystem::is_directory(path)) throw InputError(path.string() + ": cannot be read");
    try {
        return nlohmann::json::parse(file);
    } catch (const nlohmann::json::exception& e) {
        throw InputError(path.string() + ": not JSON: " + e.what());
    }
}

JsonFields::JsonFields(const nlohmann::json& object, std::string place)
    : json_(&object), place_(std::move(place)) {
    if (!object.is_object())
        throw InputError(place_ + ": wrong type: must be an object, is " + object.type_name());
}

const nlohmann::json* JsonFields::find(std::string_view name) {
    asked_.emplace(name);
    const auto it = json_->find(name);
    return it == json_->end() ? nullptr : &*it;
}

bool JsonFields::has(std::string_view name) {
    return find(name) != nullptr;
}

void JsonFields::fail(std::string_view name, const std::string& reason) const {
    throw InputError(place_ + ": " + std::string(name) + ": " + reason);
}

double JsonFields::checked(const nlohmann::json& value, std::string_view name, Allowed allowed) const {
    if (!value.is_number()) fail(name, std::string("wrong type: must be a number, is ") + value.type_name());
    const auto number = value.get<double>();
    if (!(number >= allowed.min && number <= allowed.max)) {
        fail(name, "out of range: " + shortest(number) + " is not within " + shortest(allowed.min) + " .. " +
                       shortest(allowed.max) + (allowed.unit.empty() ? "" : " ") + std::string(allowed.unit));
    }
    return number;
}

double JsonFields::number(std::string_view name, Allowed allowed) {
    const auto* value = find(name);
    if (value == nullptr) fail(name, "missing");
    return checked(*value, name, allowed);
}

double JsonFields::number(std::string_view name, Allowed allowed, double otherwise) {
    const auto* value = find(name);
    return value == nullptr ? otherwise : checked(*value, name, allowed);
}

std::int64_t JsonFields::integer(std::string_view name, Allowed allowed, std::int64_t otherwise) {
    const auto* value = find(name);
    if (value == nullptr) return otherwise;
    const double number = checked(*value, name, allowed);
    if (number != std::floor(number)) fail(name, "must be a whole number, is " + shortest(number));
    return static_cast<std::int64_t>(number);
}

std::string JsonFields::text(std::string_view name) {
    const auto* value = find(name);
    if (value == nullptr) fail(name, "missing");
    if (!value->is_string())
        fail(name, std::string("wrong type: must be a string, is ") + value->type_name());
    return value->get<std::string>();
}

std::string JsonFields::text(std::string_view name, std::string_view otherwise) {
    return has(name) ? text(name) : std::string(otherwise);
}

JsonFields JsonFields::object(std::string_view name) {
    const auto* value = find(name);
    if (value == nullptr) fail(name, "missing");
    return {*value, place_ + ": " + std::string(name)};
}

std::vector<JsonFields> JsonFields::objects(std::string_view name) {
    std::vector<JsonFields> result;
    const auto* value = find(name);
    if (value == nullptr) return result;
    if (!value->is_array()) fail(name, std::string("wrong type: must be an array, is ") + value->type_name());
    for (std::size_t i = 0; i < value->size(); ++i)
        result.emplace_back((*value)[i], place_ + ": " + std::string(name) + "[" + std::to_string(i) + "]");
    return result;
}

std::vector<std::pair<double, double>> JsonFields::pairs(std::string_view name, Allowed first,
                                                         Allowed second) {
    std::vector<std::pair<double, double>> result;
    const auto* value = find(name);
    if (value == nullptr) return result;
    if (!value->is_array()) fail(name, std::string("wrong type: must be an array, is ") + value->type_name());
    for (std::size_t i = 0; i < value->size(); ++i) {
        const auto& row = (*value)[i];
        const std::string item = std::string(name) + "[" + std::to_string(i) + "]";
        if (!row.is_array() || row.size() != 2) fail(item, "must be an array of two numbers");
        result.emplace_back(checked(row[0], item + "[0]", first), checked(row[1], item + "[1]", second));
    }
    return result;
}

void JsonFields::done() const {
    for (const auto& [key, value] : json_->items()) {
        if (asked_.contains(key)) continue;
        std::string known;
        for (const auto& name : asked_) known += (known.empty() ? "" : ", ") + name;
        fail(key, "unknown field; known here: " + known);
    }
}

}  // namespace sim
