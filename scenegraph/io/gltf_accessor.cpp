// SPDX-License-Identifier: Apache-2.0
// Reading accessors, with every bound checked before anything is allocated or read.
#include <scenegraph/io/gltf_document.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

namespace stipple {

namespace {

struct ElementView {
    const char* data = nullptr;  // nullptr: all zero
    size_t count = 0;
    size_t stride = 0;  // bytes
};

// `count` elements of `element_size` bytes from `offset` of a buffer view on, or an error if they
// are not all there.
ElementView elementsOf(const GltfDocument& document, int view, size_t offset, size_t count,
                       size_t element_size, const std::string& path) {
    const std::string_view bytes = bufferViewBytes(document, view, path + ".bufferView");
    size_t stride = document.model.bufferViews[view].byteStride;
    if (stride == 0) stride = element_size;
    if (stride < element_size) {
        document.fail(ErrorCode::kInvalidScene, path,
                      "byteStride " + std::to_string(stride) + " < the " +
                          std::to_string(element_size) + " bytes of an element");
    }
    // count < 2^32, stride < 256 and offset < 2^41 (schema): no overflow.
    if (offset + stride * (count - 1) + element_size > bytes.size()) {
        document.fail(ErrorCode::kInvalidScene, path,
                      std::to_string(count) + " elements lie beyond the " +
                          std::to_string(bytes.size()) + " bytes of bufferViews[" +
                          std::to_string(view) + "]");
    }
    return {bytes.data() + offset, count, stride};
}

template <class T>
T readValue(const char* from) {
    T value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

// Calls visit(T()) with the C++ type of a component.
template <class Visit>
void withComponentType(int component_type, const Visit& visit) {
    switch (component_type) {
        case TINYGLTF_COMPONENT_TYPE_BYTE:
            return visit(int8_t());
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return visit(uint8_t());
        case TINYGLTF_COMPONENT_TYPE_SHORT:
            return visit(int16_t());
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return visit(uint16_t());
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
            return visit(uint32_t());
        default:
            return visit(float());  // the schema allows no other
    }
}

std::string accessorPath(int accessor) { return "accessors[" + std::to_string(accessor) + "]"; }

struct SparseEntries {
    std::vector<uint32_t> targets;  // ascending, < accessor.count
    ElementView values;
};

SparseEntries sparseEntries(const GltfDocument& document, const tinygltf::Accessor& accessor,
                            size_t element_size, const std::string& path) {
    const auto& sparse = accessor.sparse;
    const size_t count = size_t(sparse.count);
    if (count > accessor.count) {
        document.fail(
            ErrorCode::kInvalidScene, path + ".sparse.count",
            std::to_string(count) + " > the accessor's count " + std::to_string(accessor.count));
    }
    SparseEntries entries;
    withComponentType(sparse.indices.componentType, [&](auto zero) {
        using T = decltype(zero);
        if constexpr (std::is_unsigned_v<T>) {
            const ElementView indices =
                elementsOf(document, sparse.indices.bufferView, size_t(sparse.indices.byteOffset),
                           count, sizeof(T), path + ".sparse.indices");
            for (size_t i = 0; i < count; ++i) {
                const uint32_t target = readValue<T>(indices.data + i * indices.stride);
                if (target >= accessor.count || (i && target <= entries.targets.back())) {
                    document.fail(ErrorCode::kInvalidScene, path + ".sparse.indices",
                                  "index " + std::to_string(target) + " is out of range or order");
                }
                entries.targets.push_back(target);
            }
        }
    });
    entries.values =
        elementsOf(document, sparse.values.bufferView, size_t(sparse.values.byteOffset), count,
                   element_size, path + ".sparse.values");
    return entries;
}

// Calls put(element, component, value) for every component of an accessor, sparse ones after the
// others.
template <class T, class Put>
void forEachComponent(const GltfDocument& document, int index, const Put& put) {
    const tinygltf::Accessor& accessor = document.model.accessors[index];
    const std::string path = accessorPath(index);
    const int components = tinygltf::GetNumComponentsInType(uint32_t(accessor.type));
    const size_t element_size = sizeof(T) * size_t(components);
    if (accessor.bufferView >= 0) {
        const ElementView view = elementsOf(document, accessor.bufferView, accessor.byteOffset,
                                            accessor.count, element_size, path);
        for (size_t i = 0; i < view.count; ++i) {
            for (int c = 0; c < components; ++c)
                put(i, c, readValue<T>(view.data + i * view.stride + c * sizeof(T)));
        }
    }
    if (accessor.sparse.isSparse) {
        const SparseEntries entries = sparseEntries(document, accessor, element_size, path);
        for (size_t i = 0; i < entries.targets.size(); ++i) {
            for (int c = 0; c < components; ++c) {
                put(entries.targets[i], c,
                    readValue<T>(entries.values.data + i * entries.values.stride + c * sizeof(T)));
            }
        }
    }
}

}  // namespace

size_t accessorCount(const GltfDocument& document, int accessor, std::initializer_list<int> types,
                     const std::string& path) {
    document.checkIndex(accessor, document.model.accessors.size(), path, "accessors");
    const tinygltf::Accessor& a = document.model.accessors[accessor];
    if (std::find(types.begin(), types.end(), a.type) == types.end()) {
        document.fail(ErrorCode::kInvalidScene, path,
                      accessorPath(accessor) + " has the wrong type for this");
    }
    // Without data an accessor is all zero, however many: bound it by memory, the others by the
    // bytes there are.
    if (a.bufferView >= 0) {
        const size_t size = size_t(tinygltf::GetComponentSizeInBytes(uint32_t(a.componentType))) *
                            size_t(tinygltf::GetNumComponentsInType(uint32_t(a.type)));
        elementsOf(document, a.bufferView, a.byteOffset, a.count, size, accessorPath(accessor));
    }
    return a.count;
}

std::vector<float> readFloats(const GltfDocument& document, int accessor, int components,
                              float fill, const std::string& path) {
    const tinygltf::Accessor& a = document.model.accessors[accessor];
    document.context.budget.require(4.0 * components * double(a.count),
                                    document.where(accessorPath(accessor)),
                                    std::to_string(a.count) + " elements");
    std::vector<float> values(a.count * size_t(components), fill);
    if (a.bufferView < 0) {
        const int given =
            std::min(components, int(tinygltf::GetNumComponentsInType(uint32_t(a.type))));
        for (size_t i = 0; i < values.size(); ++i)
            values[i] = int(i % components) < given ? 0.0f : fill;
    }
    withComponentType(a.componentType, [&](auto zero) {
        using T = decltype(zero);
        const bool normalized = a.normalized && !std::is_floating_point_v<T>;
        const float scale = normalized ? 1.0f / float(std::numeric_limits<T>::max()) : 1.0f;
        forEachComponent<T>(document, accessor, [&](size_t i, int c, T value) {
            if (c >= components) return;
            if constexpr (std::is_floating_point_v<T>) {
                if (!std::isfinite(value)) {
                    document.fail(ErrorCode::kInvalidScene, path,
                                  accessorPath(accessor) +
                                      " has a value that is not finite, in element " +
                                      std::to_string(i));
                }
            }
            // glTF: the lowest signed integer stands for -1 as its neighbour does.
            values[i * components + c] =
                normalized ? std::max(-1.0f, float(value) * scale) : float(value);
        });
    });
    return values;
}

std::vector<uint32_t> readIndices(const GltfDocument& document, int accessor,
                                  const std::string& path) {
    const tinygltf::Accessor& a = document.model.accessors[accessor];
    document.context.budget.require(4.0 * double(a.count), document.where(accessorPath(accessor)),
                                    std::to_string(a.count) + " indices");
    std::vector<uint32_t> indices(a.count, 0);
    withComponentType(a.componentType, [&](auto zero) {
        using T = decltype(zero);
        if constexpr (std::is_unsigned_v<T>) {
            forEachComponent<T>(document, accessor,
                                [&](size_t i, int, T value) { indices[i] = value; });
        } else {
            document.fail(ErrorCode::kInvalidScene, path,
                          accessorPath(accessor) + " is not of unsigned integers");
        }
    });
    return indices;
}

}  // namespace stipple
