// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/instance_json.h>

namespace stipple {

namespace {

constexpr double kMaxFactor = 1e6;  // as in the schema

}  // namespace

bool readNumbers(const Json& value, size_t n, double limit, double* result) {
    if (!value.is_array() || value.size() != n) return false;
    for (size_t i = 0; i < n; ++i) {
        if (!value[i].is_number()) return false;
        result[i] = value[i].get<double>();
        if (std::abs(result[i]) > limit) return false;
    }
    return true;
}

bool readInstance(const Json& source, JsonInstance& result) {
    if (!source.is_object()) return false;
    for (auto it = source.begin(); it != source.end(); ++it) {
        const std::string& key = it.key();
        const Json& value = it.value();
        if (key == "child") {
            if (!value.is_string()) return false;
            result.child = &value.get_ref<const std::string&>();
        } else if (key == "translation") {
            if (!readNumbers(value, 3, kMaxInstanceLength, &result.translation.x)) return false;
            result.has_parts = true;
        } else if (key == "rotation") {
            if (!readNumbers(value, 3, kMaxFactor, &result.angles.x)) return false;
            result.has_parts = result.has_angles = true;
        } else if (key == "quaternion") {
            if (!readNumbers(value, 4, kMaxFactor, result.quaternion)) return false;
            result.has_parts = result.has_quaternion = true;
        } else if (key == "scale") {
            if (value.is_number()) {
                result.scale = DVec3(value.get<double>());
                if (std::abs(result.scale.x) > kMaxFactor) return false;
            } else if (!readNumbers(value, 3, kMaxFactor, &result.scale.x)) {
                return false;
            }
            result.has_parts = true;
        } else if (key == "matrix") {
            if (!readNumbers(value, 16, kMaxInstanceLength, result.matrix)) return false;
            result.has_matrix = true;
        } else {
            return false;
        }
    }
    return result.child != nullptr;
}

const char* makeTransform(const JsonInstance& instance, Affine& result) {
    if (instance.has_matrix) {
        if (instance.has_parts) return "has a matrix and other transforms too";
        if (!affineFromMatrix(instance.matrix, result))
            return "the matrix' last row is not 0 0 0 1";
    } else {
        if (instance.has_angles && instance.has_quaternion)
            return "has both rotation and quaternion";
        DMat3 rotation(1.0);
        if (instance.has_quaternion && !rotationFromQuaternion(instance.quaternion, rotation))
            return "the quaternion is zero";
        if (instance.has_angles) rotation = rotationFromEuler(instance.angles * (kPi / 180.0));
        result = affineFromParts(instance.translation, rotation, instance.scale);
    }
    return isSingular(result.linear) ? "singular transform: it flattens what it places" : nullptr;
}

}  // namespace stipple
