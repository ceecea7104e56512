# The main scene of the test: shows the exported scene, reads the exported shader and its functions back as floats.
extends Node3D

const FOLDER := "res://skin/"
var points: Dictionary
var found := {}


func _ready() -> void:
	points = JSON.parse_string(FileAccess.get_file_as_string("res://points.json"))
	var scene: Node3D = load(FOLDER + "skin.tscn").instantiate()
	add_child(scene)
	var strip: Texture3D = load(FOLDER + "skin_color.exr")
	found["kind"] = [strip.get_class(), strip.get_width(), strip.get_height(), strip.get_depth(), strip.has_mipmaps()]
	await exported()
	for name: String in points["shaders"]:
		await packed(name, points["shaders"][name])
	for i in 4:
		await RenderingServer.frame_post_draw
	found["version"] = Engine.get_version_info()["string"]
	found["places"] = {}
	var camera := get_viewport().get_camera_3d()
	for child in scene.get_children():
		if child is MeshInstance3D:
			var at := camera.unproject_position(child.global_position)
			found["places"][child.name] = [at.x, at.y]
	JavaScriptBridge.get_interface("window").found = JSON.stringify(found)


# A texture of the points: one float texel each, in rows as the target has them.
func table(values: Array) -> ImageTexture:
	var data := PackedFloat32Array(values).to_byte_array()
	var size := Vector2i(points["width"], points["height"])
	return ImageTexture.create_from_image(Image.create_from_data(size.x, size.y, false, Image.FORMAT_RGBAF, data))


# A material on a quad that fills the view, in light from all sides alone.
func quad(material: ShaderMaterial) -> SubViewport:
	var view := viewport()
	var camera := Camera3D.new()
	camera.projection = Camera3D.PROJECTION_ORTHOGONAL
	camera.size = 1.0
	camera.position.z = 1.0
	camera.environment = Environment.new()
	camera.environment.ambient_light_source = Environment.AMBIENT_SOURCE_COLOR
	camera.environment.ambient_light_color = Color.WHITE
	camera.environment.ambient_light_energy = 1.0
	var mesh := MeshInstance3D.new()
	mesh.mesh = QuadMesh.new()
	mesh.mesh.size = Vector2(float(points["width"]) / points["height"], 1.0)
	mesh.material_override = material
	view.add_child(camera)
	view.add_child(mesh)
	return view


func plane(material: ShaderMaterial) -> SubViewport:
	var view := viewport()
	var rect := ColorRect.new()
	rect.size = view.size
	rect.material = material
	view.add_child(rect)
	return view


# The exported material itself, with maps: what 8 bits show of it.
func exported() -> void:
	var material: ShaderMaterial = load(FOLDER + "skin_light.tres").duplicate()
	material.set_shader_parameter("use_melanin_map", true)
	material.set_shader_parameter("use_hemoglobin_map", true)
	await read(quad(material), "exported", material)


# A shader that packs a channel into nibbles, 12 bits a picture: `part` 0 is the upper half.
func packed(name: String, code: String) -> void:
	var material := ShaderMaterial.new()
	material.shader = Shader.new()
	material.shader.code = code
	var view := quad(material) if "shader_type spatial" in code else plane(material)
	material.set_shader_parameter("use_melanin_map", true)
	material.set_shader_parameter("use_hemoglobin_map", true)
	for channel in 4:
		for part in 2:
			material.set_shader_parameter("channel", channel)
			material.set_shader_parameter("part", part)
			await read(view, "%s_%d_%d" % [name, channel, part], material)


func viewport() -> SubViewport:
	var view := SubViewport.new()
	view.size = Vector2i(points["width"], points["height"])
	view.own_world_3d = true
	view.render_target_update_mode = SubViewport.UPDATE_ALWAYS
	add_child(view)
	return view


func read(view: SubViewport, name: String, material: ShaderMaterial) -> void:
	material.set_shader_parameter("skin_color", load(FOLDER + "skin_color.exr"))
	material.set_shader_parameter("skin_profile", load(FOLDER + "skin_profile.exr"))
	for given in ["melanin", "eumelanin", "hemoglobin"]:
		material.set_shader_parameter(given, points[given])
	for given in ["melanin_map", "hemoglobin_map", "points"]:
		material.set_shader_parameter(given, table(points[given]))
	for i in 2:
		await RenderingServer.frame_post_draw
	var image := view.get_texture().get_image()
	image.convert(Image.FORMAT_RGBA8)
	found[name] = Marshalls.raw_to_base64(image.get_data())
