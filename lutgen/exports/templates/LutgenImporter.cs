// Sets up the textures of a lutgen export and makes its assets: Tools > Lutgen > Import.
// A Texture3D of lutgen_color.cube, and, where HDRP is installed, a Diffusion Profile per preset. Running it again
// updates the same assets. Unity 2021.3 or later.
using System;
using System.Globalization;
using System.IO;
using UnityEditor;
using UnityEngine;

public static class LutgenImporter
{
    [Serializable]
    class Profile
    {
        public string name;
        public float[] color;
        public float multiplier;
        public float ior;
    }

    [Serializable]
    class Export
    {
        public int columns;
        public int[] size;
        public float[] corners;
        public Profile[] profiles;
    }

    [MenuItem("Tools/Lutgen/Import")]
    static void Import()
    {
        foreach (string guid in AssetDatabase.FindAssets("lutgen t:TextAsset"))
        {
            string path = AssetDatabase.GUIDToAssetPath(guid);
            if (Path.GetFileName(path) == "lutgen.json")
                ImportFolder(path.Substring(0, path.LastIndexOf('/')), JsonUtility.FromJson<Export>(File.ReadAllText(path)));
        }
        AssetDatabase.SaveAssets();
    }

    static void ImportFolder(string folder, Export export)
    {
        string color = folder + "/lutgen_color.exr";
        SetUp(color, TextureImporterShape.Texture3D, export.columns, TextureImporterFormat.RGBAHalf, FilterMode.Bilinear);
        string profile = folder + "/lutgen_profile.exr";
        SetUp(profile, TextureImporterShape.Texture2D, 1, TextureImporterFormat.RGBAFloat, FilterMode.Point);
        CheckCorners(AssetDatabase.LoadAssetAtPath<Texture3D>(color), export);
        Store(ReadCube(folder + "/lutgen_color.cube"), folder + "/LutgenColorCube.asset");
        foreach (Profile values in export.profiles)
            StoreProfile(values, folder + "/" + values.name + ".asset");
        Debug.Log("lutgen: imported " + folder);
    }

    static void SetUp(string path, TextureImporterShape shape, int columns, TextureImporterFormat format, FilterMode filter)
    {
        TextureImporter importer = AssetImporter.GetAtPath(path) as TextureImporter;
        if (importer == null)
            throw new FileNotFoundException("lutgen: there is no texture " + path);
        TextureImporterSettings settings = new TextureImporterSettings();
        importer.ReadTextureSettings(settings);
        settings.textureType = TextureImporterType.Default;
        settings.textureShape = shape;
        settings.flipbookColumns = columns;
        settings.flipbookRows = 1;
        settings.sRGBTexture = false;
        settings.mipmapEnabled = false;
        settings.readable = shape == TextureImporterShape.Texture3D;
        settings.npotScale = TextureImporterNPOTScale.None;
        settings.alphaIsTransparency = false;
        settings.wrapMode = TextureWrapMode.Clamp;
        settings.filterMode = filter;
        importer.SetTextureSettings(settings);
        TextureImporterPlatformSettings platform = importer.GetDefaultPlatformTextureSettings();
        platform.format = format;
        platform.textureCompression = TextureImporterCompression.Uncompressed;
        platform.maxTextureSize = 16384;
        importer.SetPlatformTextureSettings(platform);
        importer.SaveAndReimport();
    }

    // The eight corners of the flipbook, as they were written: says at once if a slice or a row came in elsewhere.
    static void CheckCorners(Texture3D color, Export export)
    {
        for (int corner = 0; corner < 8; corner++)
        {
            int x = (corner & 1) * (export.size[0] - 1);
            int y = (corner >> 1 & 1) * (export.size[1] - 1);
            int z = (corner >> 2) * (export.size[2] - 1);
            Color texel = color.GetPixel(x, y, z);
            float off = Mathf.Abs(texel.r - export.corners[3 * corner]);
            off = Mathf.Max(off, Mathf.Abs(texel.g - export.corners[3 * corner + 1]));
            off = Mathf.Max(off, Mathf.Abs(texel.b - export.corners[3 * corner + 2]));
            if (!(off < 0.002f))
                Debug.LogError("lutgen: " + color.name + " differs at texel " + x + ", " + y + ", " + z + "; use LutgenColorCube");
        }
    }

    static Texture3D ReadCube(string path)
    {
        Color[] colors = null;
        int size = 0;
        int next = 0;
        foreach (string line in File.ReadAllLines(path))
        {
            string[] words = line.Split(' ');
            if (words[0] == "LUT_3D_SIZE")
            {
                size = int.Parse(words[1], CultureInfo.InvariantCulture);
                colors = new Color[size * size * size];
            }
            else if (words.Length == 3 && char.IsDigit(line[0]))
                colors[next++] = new Color(Number(words[0]), Number(words[1]), Number(words[2]), 1);
        }
        Texture3D texture = new Texture3D(size, size, size, TextureFormat.RGBAHalf, false);
        texture.wrapMode = TextureWrapMode.Clamp;
        texture.filterMode = FilterMode.Bilinear;
        texture.SetPixels(colors);
        texture.Apply();
        return texture;
    }

    static float Number(string word)
    {
        return float.Parse(word, CultureInfo.InvariantCulture);
    }

    // Into the asset that is there, so that what refers to it keeps it.
    static void Store(Texture3D cube, string path)
    {
        cube.name = Path.GetFileNameWithoutExtension(path);
        Texture3D there = AssetDatabase.LoadAssetAtPath<Texture3D>(path);
        if (there == null)
            AssetDatabase.CreateAsset(cube, path);
        else
            EditorUtility.CopySerialized(cube, there);
    }

    // By name and by serialized property, for projects without HDRP must compile this too.
    static void StoreProfile(Profile values, string path)
    {
        ScriptableObject profile = AssetDatabase.LoadAssetAtPath<ScriptableObject>(path);
        if (profile == null)
        {
            profile = ScriptableObject.CreateInstance("DiffusionProfileSettings");
            if (profile == null)
                return;
            AssetDatabase.CreateAsset(profile, path);
            AssetDatabase.ImportAsset(path, ImportAssetOptions.ForceUpdate); // gives the profile its hash
            profile = AssetDatabase.LoadAssetAtPath<ScriptableObject>(path);
        }
        SerializedObject serialized = new SerializedObject(profile);
        SerializedProperty multiplier = serialized.FindProperty("profile.scatteringDistanceMultiplier");
        float scale = multiplier == null ? values.multiplier : 1; // older versions have a color alone
        Color distance = new Color(scale * values.color[0], scale * values.color[1], scale * values.color[2], 1);
        serialized.FindProperty("profile.scatteringDistance").colorValue = distance;
        if (multiplier != null)
            multiplier.floatValue = values.multiplier;
        serialized.FindProperty("profile.ior").floatValue = values.ior;
        serialized.FindProperty("profile.worldScale").floatValue = 1;
        serialized.ApplyModifiedPropertiesWithoutUndo();
        AssetDatabase.SaveAssets();
        AssetDatabase.ImportAsset(path, ImportAssetOptions.ForceUpdate); // makes HDRP calculate its kernel anew
    }
}
