// SPDX-License-Identifier: Apache-2.0
#include <scenegraph/io/gltf_compression.h>

#include <draco/compression/decode.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>
#include <meshoptimizer.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace stipple {

namespace {

// A block of 256 elements takes at least 4 bytes for each byte of an element, so nothing well
// formed expands more; what claims more is refused before memory is taken.
constexpr double kMostMeshoptExpansion = 64.0;
constexpr double kDracoBytesPerFace = 100.0;  // corner table, indices and what goes with them
constexpr double kDracoBytesPerVertex = 100.0;

std::string decodeMeshopt(const GltfDocument& document, const tinygltf::Value& extension,
                          const std::string& path) {
    const auto number = [&](const char* key) {
        return extension.Has(key) ? size_t(extension.Get(key).GetNumberAsDouble()) : 0;
    };
    const auto text = [&](const char* key) {
        return extension.Has(key) ? extension.Get(key).Get<std::string>() : std::string("NONE");
    };
    const std::string mode = text("mode"), filter = text("filter");
    const size_t stride = number("byteStride"), count = number("count");
    const std::string_view source = bufferBytes(document, int(number("buffer")),
                                                number("byteOffset"), number("byteLength"), path);
    const auto invalid = [&](const std::string& message) {
        document.fail(ErrorCode::kInvalidScene, path, message);
    };
    const bool is_attributes = mode == "ATTRIBUTES";
    if (is_attributes ? stride % 4 != 0 : stride != 2 && stride != 4)
        invalid("byteStride " + std::to_string(stride) + " does not go with mode " + mode);
    if (mode == "TRIANGLES" && count % 3) invalid("count is not a multiple of 3");
    const size_t filter_stride = filter == "QUATERNION" ? 8 : 4;
    if (filter != "NONE" &&
        (!is_attributes || (stride != filter_stride && !(filter == "OCTAHEDRAL" && stride == 8) &&
                            filter != "EXPONENTIAL"))) {
        invalid("filter " + filter + " does not go with mode " + mode + " and byteStride " +
                std::to_string(stride));
    }
    const double n_bytes = double(count) * double(stride);
    if (n_bytes > kMostMeshoptExpansion * double(source.size()) + 4096.0)
        invalid("too few bytes for " + std::to_string(count) + " elements");
    document.context.budget.take(n_bytes, document.where(path), "the decoded bytes");
    std::string decoded(count * stride, '\0');
    const auto* bytes = reinterpret_cast<const unsigned char*>(source.data());
    const int result =
        is_attributes
            ? meshopt_decodeVertexBuffer(decoded.data(), count, stride, bytes, source.size())
        : mode == "TRIANGLES"
            ? meshopt_decodeIndexBuffer(decoded.data(), count, stride, bytes, source.size())
            : meshopt_decodeIndexSequence(decoded.data(), count, stride, bytes, source.size());
    if (result != 0) invalid("damaged or cut off data");
    if (filter == "OCTAHEDRAL") meshopt_decodeFilterOct(decoded.data(), count, stride);
    if (filter == "QUATERNION") meshopt_decodeFilterQuat(decoded.data(), count, stride);
    if (filter == "EXPONENTIAL") meshopt_decodeFilterExp(decoded.data(), count, stride);
    return decoded;
}

// How many faces and vertices a Draco stream says it has, read before Draco allocates them. False
// if the header is damaged or not of a mesh.
bool peekDraco(std::string_view bytes, uint32_t& n_faces, uint32_t& n_vertices) {
    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    draco::DracoHeader header;
    char magic[5];
    if (!buffer.Decode(magic, 5) || std::string_view(magic, 5) != "DRACO" ||
        !buffer.Decode(&header.version_major) || !buffer.Decode(&header.version_minor) ||
        !buffer.Decode(&header.encoder_type) || !buffer.Decode(&header.encoder_method) ||
        !buffer.Decode(&header.flags)) {
        return false;
    }
    // Older streams are laid out in other ways; glTF asks for 2.2.
    if (header.version_major != 2 || header.version_minor < 2 ||
        header.encoder_type != draco::TRIANGULAR_MESH) {
        return false;
    }
    buffer.set_bitstream_version(
        uint16_t(DRACO_BITSTREAM_VERSION(header.version_major, header.version_minor)));
    if (header.flags & METADATA_FLAG_MASK) {
        draco::GeometryMetadata metadata;
        if (!draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata)) return false;
    }
    if (header.encoder_method == draco::MESH_SEQUENTIAL_ENCODING) {
        return draco::DecodeVarint(&n_faces, &buffer) && draco::DecodeVarint(&n_vertices, &buffer);
    }
    uint8_t traversal;
    return buffer.Decode(&traversal) && draco::DecodeVarint(&n_vertices, &buffer) &&
           draco::DecodeVarint(&n_faces, &buffer);
}

float normalizationOf(int component_type) {
    switch (component_type) {
        case TINYGLTF_COMPONENT_TYPE_BYTE:
            return float(std::numeric_limits<int8_t>::max());
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
            return float(std::numeric_limits<uint8_t>::max());
        case TINYGLTF_COMPONENT_TYPE_SHORT:
            return float(std::numeric_limits<int16_t>::max());
        case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
            return float(std::numeric_limits<uint16_t>::max());
        default:
            return 1.0f;
    }
}

}  // namespace

void decodeMeshoptViews(GltfDocument& document) {
    for (size_t i = 0; i < document.model.bufferViews.size(); ++i) {
        const auto& extensions = document.model.bufferViews[i].extensions;
        const auto it = extensions.find("EXT_meshopt_compression");
        if (it == extensions.end()) continue;
        document.context.throwIfCancelled();
        document.decoded_views[int(i)] = decodeMeshopt(
            document, it->second,
            "bufferViews[" + std::to_string(i) + "].extensions.EXT_meshopt_compression");
    }
}

DracoPrimitive decodeDraco(const GltfDocument& document, const tinygltf::Primitive& primitive,
                           const std::string& primitive_path) {
    const std::string path = primitive_path + ".extensions.KHR_draco_mesh_compression";
    const tinygltf::Value& extension = primitive.extensions.at("KHR_draco_mesh_compression");
    const std::string_view bytes = bufferViewBytes(
        document, extension.Get("bufferView").GetNumberAsInt(), path + ".bufferView");
    const auto invalid = [&](const std::string& message) {
        document.fail(ErrorCode::kInvalidScene, path, message);
    };
    uint32_t n_faces = 0, n_vertices = 0;
    if (!peekDraco(bytes, n_faces, n_vertices)) invalid("not a Draco mesh of version 2.2");
    if (primitive.indices >= 0) {
        const size_t n_indices = accessorCount(document, primitive.indices, {TINYGLTF_TYPE_SCALAR},
                                               primitive_path + ".indices");
        if (size_t(n_faces) * 3 != n_indices)
            invalid("holds " + std::to_string(n_faces) +
                    " triangles, but the accessor of the "
                    "indices says " +
                    std::to_string(n_indices) + " indices");
    }
    document.context.budget.require(
        double(n_faces) * kDracoBytesPerFace + double(n_vertices) * kDracoBytesPerVertex,
        document.where(path), std::to_string(n_faces) + " triangles");

    draco::DecoderBuffer buffer;
    buffer.Init(bytes.data(), bytes.size());
    draco::Decoder decoder;
    auto decoded = decoder.DecodeMeshFromBuffer(&buffer);
    if (!decoded.ok()) invalid("damaged data: " + oneLine(decoded.status().error_msg_string()));
    const draco::Mesh& mesh = *decoded.value();

    DracoPrimitive result;
    result.vertex_count = mesh.num_points();
    result.indices.reserve(size_t(mesh.num_faces()) * 3);
    for (draco::FaceIndex f(0); f < mesh.num_faces(); ++f) {
        for (const draco::PointIndex& p : mesh.face(f)) {
            if (p.value() >= mesh.num_points()) invalid("damaged data: an index is out of range");
            result.indices.push_back(p.value());
        }
    }
    const tinygltf::Value& ids = extension.Get("attributes");
    for (const std::string& name : ids.Keys()) {
        const std::string place = path + ".attributes." + oneLine(name, 40);
        const auto accessor = primitive.attributes.find(name);
        const draco::PointAttribute* attribute =
            mesh.GetAttributeByUniqueId(uint32_t(ids.Get(name).GetNumberAsInt()));
        if (accessor == primitive.attributes.end() || !attribute)
            document.fail(ErrorCode::kInvalidScene, place, "there is no such attribute");
        document.checkIndex(accessor->second, document.model.accessors.size(), place, "accessors");
        const tinygltf::Accessor& a = document.model.accessors[accessor->second];
        DracoAttribute& out = result.attributes[name];
        out.components = std::min<int>(attribute->num_components(), 4);
        document.context.budget.require(4.0 * out.components * double(result.vertex_count),
                                        document.where(place), "its values");
        out.values.resize(result.vertex_count * size_t(out.components));
        const float scale = a.normalized && !attribute->normalized()
                                ? 1.0f / normalizationOf(a.componentType)
                                : 1.0f;
        for (size_t i = 0; i < result.vertex_count; ++i) {
            const auto index = attribute->mapped_index(draco::PointIndex(uint32_t(i)));
            float* to = out.values.data() + i * size_t(out.components);
            if (index.value() >= attribute->size() ||
                !attribute->ConvertValue<float>(index, int8_t(out.components), to)) {
                document.fail(ErrorCode::kInvalidScene, place, "damaged data");
            }
            for (int c = 0; c < out.components; ++c) {
                if (!std::isfinite(to[c]))
                    document.fail(ErrorCode::kInvalidScene, place,
                                  "has a value that is not finite");
                to[c] = std::max(to[c] * scale, a.normalized ? -1.0f : to[c] * scale);
            }
        }
    }
    return result;
}

}  // namespace stipple
